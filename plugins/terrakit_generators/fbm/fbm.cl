// Fractal gradient noise. Twin of reference.py.
// always_inline: a call that is left in the loop keeps PoCL from making it wide.

// Direction of a lattice gradient: quarter turns from two bits, the angle inside from the rest.
// sin(pi/2 t) by an odd polynomial; its error of 1e-4 is invisible and the same everywhere.
inline float fbm_quarter_sine(float t)
{
    const float s = t * t;
    return t * (1.57079032f + s * (-0.64589283f + s * (0.07943441f + s * -0.00433310f)));
}

__attribute__((always_inline)) inline float fbm_corner(uint hash, float x, float y)
{
    const float t = (float)(hash >> 8) * 5.9604644775390625e-8f;
    const float c = fbm_quarter_sine(1.0f - t);
    const float s = fbm_quarter_sine(t);
    const float gx = (hash & 1u) ? -c : c;
    const float gy = (hash & 2u) ? -s : s;
    return gx * x + gy * y;
}

inline float fbm_fade(float t)
{
    return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
}

// One octave at a lattice position in 32.32 fixed point; within -1 to 1.
__attribute__((always_inline)) inline float fbm_noise(long u, long v, uint seed_low, uint seed_high)
{
    const int i = (int)(u >> 32);
    const int j = (int)(v >> 32);
    const float x = (float)((uint)u >> 8) * 5.9604644775390625e-8f;
    const float y = (float)((uint)v >> 8) * 5.9604644775390625e-8f;
    const uint column_west = exact_mix((uint)i ^ seed_low);
    const uint column_east = exact_mix((uint)(i + 1) ^ seed_low);
    const uint sw = exact_mix(exact_mix(column_west + (uint)j) ^ seed_high);
    const uint se = exact_mix(exact_mix(column_east + (uint)j) ^ seed_high);
    const uint nw = exact_mix(exact_mix(column_west + (uint)(j + 1)) ^ seed_high);
    const uint ne = exact_mix(exact_mix(column_east + (uint)(j + 1)) ^ seed_high);
    const float a = fbm_corner(sw, x, y);
    const float b = fbm_corner(se, x - 1.0f, y);
    const float c = fbm_corner(nw, x, y - 1.0f);
    const float d = fbm_corner(ne, x - 1.0f, y - 1.0f);
    const float fx = fbm_fade(x);
    const float fy = fbm_fade(y);
    const float south = a + fx * (b - a);
    const float north = c + fx * (d - c);
    return (south + fy * (north - south)) * 1.41421356f;
}

// lattice: six longs an octave: u at the first sample, per column, per row; the same for v.
// octave: weight of each octave in metres; seeds: two words each.
__kernel void fbm_sum(
    __global float *elevation,
    __global const long *lattice,
    __global const float *weight,
    __global const uint *seeds,
    const int octaves,
    const float offset,
    const int rows,
    const int cols)
{
#ifdef TERRAKIT_CPU
    // A row an item, octave by octave: the inner loop is wide
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    __global float *restrict line = elevation + (size_t)row * cols;
    for (int col = 0; col < cols; ++col) line[col] = offset;
    for (int k = 0; k < octaves; ++k) {
        const long u0 = lattice[6 * k] + row * lattice[6 * k + 2];
        const long v0 = lattice[6 * k + 3] + row * lattice[6 * k + 5];
        const long du = lattice[6 * k + 1];
        const long dv = lattice[6 * k + 4];
        const float height = weight[k];
        const uint low = seeds[2 * k];
        const uint high = seeds[2 * k + 1];
        _Pragma("clang loop vectorize(assume_safety)")
        for (int col = 0; col < cols; ++col) {
            line[col] = line[col] + height * fbm_noise(u0 + col * du, v0 + col * dv, low, high);
        }
    }
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    float sum = offset;
    for (int k = 0; k < octaves; ++k) {
        const long u = lattice[6 * k] + col * lattice[6 * k + 1] + row * lattice[6 * k + 2];
        const long v = lattice[6 * k + 3] + col * lattice[6 * k + 4] + row * lattice[6 * k + 5];
        sum = sum + weight[k] * fbm_noise(u, v, seeds[2 * k], seeds[2 * k + 1]);
    }
    elevation[(size_t)row * cols + col] = sum;
#endif
}
