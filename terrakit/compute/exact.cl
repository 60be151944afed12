// Put before every kernel file. What is here has a twin in exact.py that returns the same bits:
// only + - * / sqrt, comparisons and integer work; no contraction, no library functions.

#pragma OPENCL FP_CONTRACT OFF

// Integer hash with full avalanche (Wellons 2018, "lowbias32").
__attribute__((always_inline)) inline uint exact_mix(uint x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    x ^= x >> 16;
    return x;
}

// Hash of a seed and a lattice point: never a sequence, never a tile index.
__attribute__((always_inline)) inline uint exact_hash(uint seed_low, uint seed_high, int i, int j)
{
    return exact_mix(exact_mix(exact_mix((uint)i ^ seed_low) + (uint)j) ^ seed_high);
}

// Uniform in [0, 1), exact in float32.
__attribute__((always_inline)) inline float exact_uniform(uint hash)
{
    return (float)(hash >> 8) * 5.9604644775390625e-8f;
}

// The library's floor, bit for bit; PoCL makes a call of that one, which leaves loops scalar.
__attribute__((always_inline)) inline float exact_floor(float x)
{
    const int is_small = x > -8388608.0f && x < 8388608.0f;  // others are whole, or no number
    const float held = is_small ? x : 0.0f;
    const float cut = (float)(int)held;
    const float below = cut > held ? cut - 1.0f : cut;
    return is_small && cut != held ? below : x;
}

// Base-2 logarithm of a positive, normal float; absolute error below 2e-7 for x near 1.
__attribute__((always_inline)) inline float exact_log2(float x)
{
    const int bits = as_int(x);
    int exponent = (bits >> 23) - 127;
    float mantissa = as_float((bits & 0x007fffff) | 0x3f800000);
    if (mantissa > 1.41421356f) {
        mantissa = mantissa * 0.5f;
        exponent = exponent + 1;
    }
    const float t = (mantissa - 1.0f) / (mantissa + 1.0f);
    const float s = t * t;
    float p = 0.26230818925253880f;
    p = p * s + 0.32059889797532520f;
    p = p * s + 0.41219858311113240f;
    p = p * s + 0.57707801635558540f;
    p = p * s + 0.96179669392597560f;
    p = p * s + 2.88539008177792680f;
    return (float)exponent + t * p;
}

// 2 to the power x; 0 below the range of normal floats, the largest power above it.
__attribute__((always_inline)) inline float exact_exp2(float x)
{
    const float clamped = x < -126.0f ? -126.0f : (x > 127.0f ? 127.0f : x);
    const float whole = exact_floor(clamped + 0.5f);
    const float f = clamped - whole;
    float p = 1.5252733804059840e-5f;
    p = p * f + 1.5403530393381608e-4f;
    p = p * f + 1.3333558146428443e-3f;
    p = p * f + 9.6181291076284770e-3f;
    p = p * f + 5.5504108664821580e-2f;
    p = p * f + 2.4022650695910070e-1f;
    p = p * f + 6.9314718055994530e-1f;
    p = p * f + 1.0f;
    const float scale = as_float(((int)whole + 127) << 23);
    return x < -126.0f ? 0.0f : p * scale;
}

// x to the power y for x >= 0; 0 to any positive power is 0.
__attribute__((always_inline)) inline float exact_power(float x, float y)
{
    return !(x >= 1.17549435e-38f) ? (y == 0.0f ? 1.0f : 0.0f) : exact_exp2(y * exact_log2(x));
}

// Sine of a whole circle's share: sin(2 pi t). Odd Taylor polynomial on a quarter turn.
__attribute__((always_inline)) inline float exact_sine(float t)
{
    const float r = t - exact_floor(t + 0.5f);
    const float q = r > 0.25f ? 0.5f - r : (r < -0.25f ? -0.5f - r : r);
    const float s = q * q;
    float p = -15.0946425768229730f;
    p = p * s + 42.0586939448786400f;
    p = p * s + -76.7058597530613900f;
    p = p * s + 81.6052492760750500f;
    p = p * s + -41.3417022403997600f;
    p = p * s + 6.28318530717958650f;
    return q * p;
}

// Direction of (x, y) as a share of a circle, -1/2 to 1/2; 0 for no direction.
__attribute__((always_inline)) inline float exact_arctangent(float y, float x)
{
    const float ax = x < 0.0f ? -x : x;
    const float ay = y < 0.0f ? -y : y;
    const float low = ax < ay ? ax : ay;
    const float high = ax < ay ? ay : ax;
    const float r = low / (high > 1e-30f ? high : 1e-30f);
    const float s = r * r;
    float p = 0.00108412954328f;
    p = p * s + -0.00534827649107f;
    p = p * s + 0.01267250269068f;
    p = p * s + -0.02106152176488f;
    p = p * s + 0.03152511981160f;
    p = p * s + -0.05302623867888f;
    p = p * s + 0.15915432426105f;
    const float octant = r * p;
    const float quarter = ax < ay ? 0.25f - octant : octant;
    const float half_turn = x < 0.0f ? 0.5f - quarter : quarter;
    return y < 0.0f ? -half_turn : half_turn;
}

// Nearly normal number of mean 0 and deviation 1: four uniforms of 16 bits, within -3.47 to 3.47.
__attribute__((always_inline)) inline float exact_normal(uint hash)
{
    const uint other = exact_mix(hash ^ 0x9e3779b9u);
    const uint sum = (hash & 0xffffu) + (hash >> 16) + (other & 0xffffu) + (other >> 16);
    return (float)((int)sum - 131070) * 2.6428998e-5f;
}
