// Lattice noise: one octave at a time, for kernels to sum, bend and fold. Twin of reference.py.
//
// Every basis is float noise_NAME(int i, int j, float x, float y, uint low, uint high): the cell
// (i, j) of the lattice, wrapping at 2^32, the fraction x, y in it, in [0, 1), and two seed words.
// Only inlined arithmetic and selects: a call or a branch keeps the loop around it scalar.

#define NOISE __attribute__((always_inline)) inline

// Put before a loop over samples of a row. The width is said, because the widest type in the loop,
// the 64-bit position, would make the compiler choose half of it or less.
#ifndef NOISE_LANES
#define NOISE_LANES 16
#endif
#define NOISE_TEXT(x) #x
#define NOISE_PRAGMA(x) _Pragma(NOISE_TEXT(x))
#ifdef TERRAKIT_CPU
#define NOISE_LOOP_OF(lanes) \
    NOISE_PRAGMA(clang loop vectorize(assume_safety) vectorize_width(lanes))
#define NOISE_LOOP NOISE_LOOP_OF(NOISE_LANES)
#else
#define NOISE_LOOP
#endif

// Positions along a row, in 32.32 fixed point, from words of 32 bits: a loop with 64-bit numbers in
// it is half as wide. Good for 256 positions, of which NOISE_START is the first; then start again.
//
//     NOISE_START(u, first, step)
//     NOISE_LOOP for (...) { ... NOISE_CELL(u) ... NOISE_FRACTION(u) ...; NOISE_STEP(u) }
#define NOISE_START(u, first, step)                                                              \
    uint u##_cell = (uint)((ulong)(first) >> 32), u##_main = (uint)(first) >> 8;                 \
    uint u##_rest = (uint)(first) & 255u;                                                        \
    const uint u##_cell_step = (uint)((ulong)(step) >> 32), u##_main_step = (uint)(step) >> 8;   \
    const uint u##_rest_step = (uint)(step) & 255u;
#define NOISE_STEP(u)              \
    u##_cell += u##_cell_step;     \
    u##_main += u##_main_step;     \
    u##_rest += u##_rest_step;
#define NOISE_CARRIED(u) (u##_main + (u##_rest >> 8))
#define NOISE_CELL(u) (int)(u##_cell + (NOISE_CARRIED(u) >> 24))
#define NOISE_FRACTION(u) ((float)(int)(NOISE_CARRIED(u) & 0xffffffu) * 5.9604644775390625e-8f)

// Correctly rounded like sqrt(), which is a library call that stops wide loops on processors.
#ifdef TERRAKIT_CPU
#define noise_root(x) __builtin_sqrtf(x)
#else
#define noise_root(x) sqrt(x)
#endif

#define NOISE_COLUMN 0x9e3779b1u
#define NOISE_ROW 0x85ebca77u

NOISE float noise_magnitude(float x)
{
    return as_float(as_uint(x) & 0x7fffffffu);
}

// Seed words of the columns and of the rows. Loops over samples hoist them.
NOISE uint noise_column_seed(uint low)
{
    return exact_mix(low + 0x68e31da4u);
}

NOISE uint noise_row_seed(uint low, uint high)
{
    return exact_mix(high ^ noise_column_seed(low));
}

// Word of a lattice line; product is its index times NOISE_COLUMN or NOISE_ROW.
NOISE uint noise_line(uint product, uint seed)
{
    return product ^ (product >> 15) ^ seed;
}

// The hash of a lattice point is the product of the words of its column and its row: one multiply
// a point. High bits are good; this spreads them where low bits are needed too.
NOISE uint noise_spread(uint hash)
{
    const uint h = hash ^ (hash >> 15);
    return h * 0x846ca68bu;
}

// In [-1, 1], from the high bits.
NOISE float noise_signed(uint hash)
{
    return (float)(int)hash * 4.656612873077393e-10f;
}

// 6 t^5 - 15 t^4 + 10 t^3 and its slope.
NOISE float noise_fade(float t)
{
    return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
}

NOISE float noise_fade_slope(float t)
{
    const float s = t * (t - 1.0f);
    return 30.0f * (s * s);
}

// Lattice gradient from the middle to anywhere on the square with corners on the axes, times 2^31.
NOISE void noise_direction(uint hash, float *gx, float *gy)
{
    const float p = (float)(int)hash;
    const uint rest = as_uint(2147483648.0f - noise_magnitude(p));
    *gx = p;
    *gy = as_float(rest ^ ((hash << 16) & 0x80000000u));
}

// One value a cell, in [-1, 1].
NOISE float noise_white(int i, int j, float x, float y, uint low, uint high)
{
    const uint column = noise_line((uint)i * NOISE_COLUMN, noise_column_seed(low));
    const uint row = noise_line((uint)j * NOISE_ROW, noise_row_seed(low, high));
    return noise_signed(noise_spread(column * row));
}

// Values at lattice points, joined by quintics; in [-1, 1].
NOISE float noise_value_slope(
    int i, int j, float x, float y, uint low, uint high, float *dx, float *dy)
{
    const uint column_seed = noise_column_seed(low);
    const uint row_seed = noise_row_seed(low, high);
    const uint column = (uint)i * NOISE_COLUMN;
    const uint row = (uint)j * NOISE_ROW;
    const uint west = noise_line(column, column_seed);
    const uint east = noise_line(column + NOISE_COLUMN, column_seed);
    const uint south = noise_line(row, row_seed);
    const uint north = noise_line(row + NOISE_ROW, row_seed);
    const float a = noise_signed(west * south);
    const float b = noise_signed(east * south);
    const float c = noise_signed(west * north);
    const float d = noise_signed(east * north);
    const float fx = noise_fade(x);
    const float fy = noise_fade(y);
    const float low_side = a + fx * (b - a);
    const float high_side = c + fx * (d - c);
    *dx = noise_fade_slope(x) * ((b - a) + fy * ((d - c) - (b - a)));
    *dy = noise_fade_slope(y) * (high_side - low_side);
    return low_side + fy * (high_side - low_side);
}

NOISE float noise_value(int i, int j, float x, float y, uint low, uint high)
{
    float dx, dy;
    return noise_value_slope(i, j, x, y, low, high, &dx, &dy);
}

// Gradients at lattice points, joined by quintics (Perlin 2002); in [-1, 1].
#define NOISE_GRADIENT_SCALE 8.6994456e-10f
NOISE float noise_gradient_slope(
    int i, int j, float x, float y, uint low, uint high, float *dx, float *dy)
{
    const uint column_seed = noise_column_seed(low);
    const uint row_seed = noise_row_seed(low, high);
    const uint column = (uint)i * NOISE_COLUMN;
    const uint row = (uint)j * NOISE_ROW;
    const uint west = noise_line(column, column_seed);
    const uint east = noise_line(column + NOISE_COLUMN, column_seed);
    const uint south = noise_line(row, row_seed);
    const uint north = noise_line(row + NOISE_ROW, row_seed);
    float ax, ay, bx, by, cx, cy, ex, ey;
    noise_direction(west * south, &ax, &ay);
    noise_direction(east * south, &bx, &by);
    noise_direction(west * north, &cx, &cy);
    noise_direction(east * north, &ex, &ey);
    const float x1 = x - 1.0f;
    const float y1 = y - 1.0f;
    const float a = ax * x + ay * y;
    const float b = bx * x1 + by * y;
    const float c = cx * x + cy * y1;
    const float d = ex * x1 + ey * y1;
    const float fx = noise_fade(x);
    const float fy = noise_fade(y);
    const float low_side = a + fx * (b - a);
    const float high_side = c + fx * (d - c);
    const float low_x = ax + fx * (bx - ax);
    const float high_x = cx + fx * (ex - cx);
    const float low_y = ay + fx * (by - ay);
    const float high_y = cy + fx * (ey - cy);
    const float across = (b - a) + fy * ((d - c) - (b - a));
    const float along_x = (low_x + fy * (high_x - low_x)) + noise_fade_slope(x) * across;
    const float along_y =
        (low_y + fy * (high_y - low_y)) + noise_fade_slope(y) * (high_side - low_side);
    *dx = along_x * NOISE_GRADIENT_SCALE;
    *dy = along_y * NOISE_GRADIENT_SCALE;
    return (low_side + fy * (high_side - low_side)) * NOISE_GRADIENT_SCALE;
}

NOISE float noise_gradient(int i, int j, float x, float y, uint low, uint high)
{
    float dx, dy;
    return noise_gradient_slope(i, j, x, y, low, high, &dx, &dy);
}

// Gradients at the corners of triangles (Perlin 2001), each fading to nothing at 1/sqrt(2).
// The position is skewed: the lattice of the caller has sides along the triangles'.
#define NOISE_UNSKEW 0.21132487f
#define NOISE_SIMPLEX_SCALE 4.765417e-8f
NOISE float noise_simplex_slope(
    int i, int j, float x, float y, uint low, uint high, float *dx, float *dy)
{
    const uint column_seed = noise_column_seed(low);
    const uint row_seed = noise_row_seed(low, high);
    const uint column = (uint)i * NOISE_COLUMN;
    const uint row = (uint)j * NOISE_ROW;
    const uint west = noise_line(column, column_seed);
    const uint east = noise_line(column + NOISE_COLUMN, column_seed);
    const uint south = noise_line(row, row_seed);
    const uint north = noise_line(row + NOISE_ROW, row_seed);

    // The middle corner is the south-east or the north-west one
    const bool right = x > y;
    const uint middle_column = right ? east : west;
    const uint middle_row = right ? south : north;
    const float unskew = (x + y) * NOISE_UNSKEW;
    const float x0 = x - unskew;
    const float y0 = y - unskew;
    const float x1 = x0 + (right ? NOISE_UNSKEW - 1.0f : NOISE_UNSKEW);
    const float y1 = y0 + (right ? NOISE_UNSKEW : NOISE_UNSKEW - 1.0f);
    const float x2 = x0 + (2.0f * NOISE_UNSKEW - 1.0f);
    const float y2 = y0 + (2.0f * NOISE_UNSKEW - 1.0f);

    float ax, ay, bx, by, cx, cy;
    noise_direction(west * south, &ax, &ay);
    noise_direction(middle_column * middle_row, &bx, &by);
    noise_direction(east * north, &cx, &cy);
    const float a = ax * x0 + ay * y0;
    const float b = bx * x1 + by * y1;
    const float c = cx * x2 + cy * y2;
    const float reach_a = 0.5f - (x0 * x0 + y0 * y0);
    const float reach_b = 0.5f - (x1 * x1 + y1 * y1);
    const float reach_c = 0.5f - (x2 * x2 + y2 * y2);
    const float ta = reach_a > 0.0f ? reach_a : 0.0f;
    const float tb = reach_b > 0.0f ? reach_b : 0.0f;
    const float tc = reach_c > 0.0f ? reach_c : 0.0f;
    const float sa = ta * ta;
    const float sb = tb * tb;
    const float sc = tc * tc;
    const float pa = sa * sa;
    const float pb = sb * sb;
    const float pc = sc * sc;

    // Slope along the straight axes
    const float fa = 8.0f * (sa * ta) * a;
    const float fb = 8.0f * (sb * tb) * b;
    const float fc = 8.0f * (sc * tc) * c;
    const float ux = ((pa * ax - fa * x0) + (pb * bx - fb * x1)) + (pc * cx - fc * x2);
    const float uy = ((pa * ay - fa * y0) + (pb * by - fb * y1)) + (pc * cy - fc * y2);
    *dx = ux * NOISE_SIMPLEX_SCALE;
    *dy = uy * NOISE_SIMPLEX_SCALE;
    return ((pa * a + pb * b) + pc * c) * NOISE_SIMPLEX_SCALE;
}

NOISE float noise_simplex(int i, int j, float x, float y, uint low, uint high)
{
    float dx, dy;
    return noise_simplex_slope(i, j, x, y, low, high, &dx, &dy);
}
