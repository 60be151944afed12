// Put before every kernel file. What is here has a twin in exact.py that returns the same bits:
// only + - * / sqrt, comparisons and integer work; no contraction, no library functions.

#pragma OPENCL FP_CONTRACT OFF

// Integer hash with full avalanche (Wellons 2018, "lowbias32").
inline uint exact_mix(uint x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    x ^= x >> 16;
    return x;
}

// Hash of a seed and a lattice point: never a sequence, never a tile index.
inline uint exact_hash(uint seed_low, uint seed_high, int i, int j)
{
    return exact_mix(exact_mix(exact_mix((uint)i ^ seed_low) + (uint)j) ^ seed_high);
}

// Uniform in [0, 1), exact in float32.
inline float exact_uniform(uint hash)
{
    return (float)(hash >> 8) * 5.9604644775390625e-8f;
}

// Base-2 logarithm of a positive, normal float; absolute error below 2e-7 for x near 1.
inline float exact_log2(float x)
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
inline float exact_exp2(float x)
{
    const float clamped = x < -126.0f ? -126.0f : (x > 127.0f ? 127.0f : x);
    const float whole = floor(clamped + 0.5f);
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
inline float exact_power(float x, float y)
{
    return x < 1.17549435e-38f ? (y == 0.0f ? 1.0f : 0.0f) : exact_exp2(y * exact_log2(x));
}
