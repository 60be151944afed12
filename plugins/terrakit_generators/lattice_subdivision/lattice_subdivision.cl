// Terrain by repeated halving of a lattice. Twin of reference.py.
//
// One work-item makes the four points of the finer lattice that belong to one point of the coarser
// one: itself, its neighbours half a step east and south, and the centre between them. What it
// needs of its neighbours' new points it computes again, so that nothing read is ever written.
// LATTICE_UNIFORM: random heights are uniform instead of nearly normal.
// LATTICE_ADDITIONS: points that are already there are displaced again at every level.
// always_inline: a call that is left in the loop keeps PoCL from making it wide.

typedef struct {
    uint low;      // seed of the first half-step: centres, or every point
    uint high;
    uint low2;     // seed of the second half-step: the middles of edges
    uint high2;
    float first;   // deviation of the random heights of each half-step, metres
    float second;
} lattice_subdivision_noise;

__attribute__((always_inline)) inline float lattice_subdivision_random(
    uint low, uint high, int col, int row)
{
    const uint hash = exact_hash(low, high, col, row);
#ifdef LATTICE_UNIFORM
    return (exact_uniform(hash) - 0.5f) * 3.4641016f;
#else
    return exact_normal(hash);
#endif
}

__attribute__((always_inline)) inline float lattice_subdivision_first(
    const lattice_subdivision_noise n, int col, int row)
{
    return n.first * lattice_subdivision_random(n.low, n.high, col, row);
}

__attribute__((always_inline)) inline float lattice_subdivision_second(
    const lattice_subdivision_noise n, int col, int row)
{
    return n.second * lattice_subdivision_random(n.low2, n.high2, col, row);
}

// Height of a centre after the first half-step; i is its north-west corner, col and row are odd.
__attribute__((always_inline)) inline float lattice_subdivision_centre(
    __global const float *coarse, int i, int width,
    const lattice_subdivision_noise n, int col, int row)
{
    const float sum = (coarse[i] + coarse[i + width + 1]) + (coarse[i + 1] + coarse[i + width]);
    return sum * 0.25f + lattice_subdivision_first(n, col, row);
}

// Height of an old point after the first half-step.
__attribute__((always_inline)) inline float lattice_subdivision_corner(
    __global const float *coarse, int i, const lattice_subdivision_noise n,
    int col, int row)
{
#ifdef LATTICE_ADDITIONS
    return coarse[i] + lattice_subdivision_first(n, col, row);
#else
    return coarse[i];
#endif
}

// Diamond, then square: an edge's middle is the mean of its two ends and the two centres beside it.
__attribute__((always_inline)) inline void lattice_subdivision_diamond_square_cell(
    __global float *fine, __global const float *coarse,
    int i, int k, int width, int fine_width, const lattice_subdivision_noise n, int col, int row)
{
    const float corner = lattice_subdivision_corner(coarse, i, n, col, row);
    const float east = lattice_subdivision_corner(coarse, i + 1, n, col + 2, row);
    const float south = lattice_subdivision_corner(coarse, i + width, n, col, row + 2);
    const float centre = lattice_subdivision_centre(coarse, i, width, n, col + 1, row + 1);
    const float above = lattice_subdivision_centre(coarse, i - width, width, n, col + 1, row - 1);
    const float left = lattice_subdivision_centre(coarse, i - 1, width, n, col - 1, row + 1);
    const float across = ((corner + east) + (above + centre)) * 0.25f;
    const float down = ((corner + south) + (left + centre)) * 0.25f;
#ifdef LATTICE_ADDITIONS
    fine[k] = corner + lattice_subdivision_second(n, col, row);
    fine[k + fine_width + 1] = centre + lattice_subdivision_second(n, col + 1, row + 1);
#else
    fine[k] = corner;
    fine[k + fine_width + 1] = centre;
#endif
    fine[k + 1] = across + lattice_subdivision_second(n, col + 1, row);
    fine[k + fine_width] = down + lattice_subdivision_second(n, col, row + 1);
}

// Edges from their two ends, centres from their four corners.
__attribute__((always_inline)) inline void lattice_subdivision_midpoint_cell(
    __global float *fine, __global const float *coarse,
    int i, int k, int width, int fine_width, const lattice_subdivision_noise n, int col, int row)
{
    const float corner = coarse[i];
    const float across = (corner + coarse[i + 1]) * 0.5f;
    const float down = (corner + coarse[i + width]) * 0.5f;
#ifdef LATTICE_ADDITIONS
    fine[k] = corner + lattice_subdivision_second(n, col, row);
#else
    fine[k] = corner;
#endif
    fine[k + 1] = across + lattice_subdivision_second(n, col + 1, row);
    fine[k + fine_width] = down + lattice_subdivision_second(n, col, row + 1);
    fine[k + fine_width + 1] = lattice_subdivision_centre(coarse, i, width, n, col + 1, row + 1);
}

// Weights 9, 3, 3 and 1 of the four old points around: the quarter points of a biquadratic spline.
__attribute__((always_inline)) inline float lattice_subdivision_quarter(
    float near, float beside, float below, float far)
{
    return (9.0f * near + 3.0f * (beside + below) + far) * 0.0625f;
}

__attribute__((always_inline)) inline void lattice_subdivision_square_square_cell(
    __global float *fine, __global const float *coarse,
    int i, int k, int width, int fine_width, const lattice_subdivision_noise n, int col, int row)
{
    const float a = coarse[i];
    const float b = coarse[i + 1];
    const float c = coarse[i + width];
    const float d = coarse[i + width + 1];
    fine[k] = lattice_subdivision_quarter(a, b, c, d) + lattice_subdivision_first(n, col, row);
    fine[k + 1] =
        lattice_subdivision_quarter(b, a, d, c) + lattice_subdivision_first(n, col + 1, row);
    fine[k + fine_width] =
        lattice_subdivision_quarter(c, a, d, b) + lattice_subdivision_first(n, col, row + 1);
    fine[k + fine_width + 1] =
        lattice_subdivision_quarter(d, b, c, a) + lattice_subdivision_first(n, col + 1, row + 1);
}

// One level finer. rows, cols: points of the coarse lattice that get four points each; north, west:
// where the first of them lies in the array; first_row, first_col: its world index, times two.
#ifdef TERRAKIT_CPU
#define LATTICE_SUBDIVISION_REFINE(name, cell) \
__kernel void name( \
    __global float *fine, __global const float *coarse, \
    const uint low, const uint high, const uint low2, const uint high2, \
    const float first, const float second, \
    const int first_row, const int first_col, const int north, const int west, \
    const int rows, const int cols, const int width) \
{ \
    const int r = (int)get_global_id(0); \
    if (r >= rows) return; \
    const lattice_subdivision_noise n = {low, high, low2, high2, first, second}; \
    _Pragma("clang loop vectorize(assume_safety)") \
    for (int c = 0; c < cols; ++c) { \
        cell(fine, coarse, (r + north) * width + c + west, 4 * r * cols + 2 * c, width, 2 * cols, \
             n, (int)((uint)first_col + 2u * (uint)c), (int)((uint)first_row + 2u * (uint)r)); \
    } \
}
#else
#define LATTICE_SUBDIVISION_REFINE(name, cell) \
__kernel void name( \
    __global float *fine, __global const float *coarse, \
    const uint low, const uint high, const uint low2, const uint high2, \
    const float first, const float second, \
    const int first_row, const int first_col, const int north, const int west, \
    const int rows, const int cols, const int width) \
{ \
    const int c = (int)get_global_id(0); \
    const int r = (int)get_global_id(1); \
    if (c >= cols || r >= rows) return; \
    const lattice_subdivision_noise n = {low, high, low2, high2, first, second}; \
    cell(fine, coarse, (r + north) * width + c + west, 4 * r * cols + 2 * c, width, 2 * cols, \
         n, (int)((uint)first_col + 2u * (uint)c), (int)((uint)first_row + 2u * (uint)r)); \
}
#endif

LATTICE_SUBDIVISION_REFINE(
    lattice_subdivision_diamond_square, lattice_subdivision_diamond_square_cell)
LATTICE_SUBDIVISION_REFINE(lattice_subdivision_midpoint, lattice_subdivision_midpoint_cell)
LATTICE_SUBDIVISION_REFINE(
    lattice_subdivision_square_square, lattice_subdivision_square_square_cell)

// Random heights of the coarsest lattice.
__kernel void lattice_subdivision_scatter(
    __global float *coarse, const uint low, const uint high, const float height,
    const int first_row, const int first_col, const int rows, const int cols)
{
    const int c = (int)get_global_id(0);
    const int r = (int)get_global_id(1);
    if (c >= cols || r >= rows) return;
    coarse[r * cols + c] =
        height * lattice_subdivision_random(low, high, first_col + c, first_row + r);
}

// Heights at the samples: four by four points of the finest lattice, by the weights of each axis.
__attribute__((always_inline)) inline float lattice_subdivision_between(
    __global const float *lattice, int i,
    float w0, float w1, float w2, float w3)
{
    return (w0 * lattice[i] + w1 * lattice[i + 1]) + (w2 * lattice[i + 2] + w3 * lattice[i + 3]);
}

__attribute__((always_inline)) inline float lattice_subdivision_sampled(
    __global const float *lattice, int i, int width,
    __global const float *across, int c, int cols,
    float v0, float v1, float v2, float v3)
{
    const float w0 = across[c];
    const float w1 = across[cols + c];
    const float w2 = across[2 * cols + c];
    const float w3 = across[3 * cols + c];
    const float a = lattice_subdivision_between(lattice, i, w0, w1, w2, w3);
    const float b = lattice_subdivision_between(lattice, i + width, w0, w1, w2, w3);
    const float e = lattice_subdivision_between(lattice, i + 2 * width, w0, w1, w2, w3);
    const float d = lattice_subdivision_between(lattice, i + 3 * width, w0, w1, w2, w3);
    return (v0 * a + v1 * b) + (v2 * e + v3 * d);
}

// col_at, row_at: first of the four points; across, down: the four weights, one row of each.
// first: row of the map at which this band begins.
__kernel void lattice_subdivision_sample(
    __global float *elevation, __global const float *lattice,
    __global const int *col_at, __global const float *across,
    __global const int *row_at, __global const float *down,
    const float offset, const int first, const int rows, const int cols, const int width)
{
#ifdef TERRAKIT_CPU
    const int r = (int)get_global_id(0);
    if (r >= rows) return;
    __global float *line = elevation + (size_t)(first + r) * cols;
    const int start = row_at[r] * width;
    const float v0 = down[r];
    const float v1 = down[rows + r];
    const float v2 = down[2 * rows + r];
    const float v3 = down[3 * rows + r];
    _Pragma("clang loop vectorize(assume_safety)")
    for (int c = 0; c < cols; ++c) {
        line[c] = offset + lattice_subdivision_sampled(
            lattice, start + col_at[c], width, across, c, cols, v0, v1, v2, v3);
    }
#else
    const int c = (int)get_global_id(0);
    const int r = (int)get_global_id(1);
    if (c >= cols || r >= rows) return;
    elevation[(size_t)(first + r) * cols + c] = offset + lattice_subdivision_sampled(
        lattice, row_at[r] * width + col_at[c], width, across, c, cols,
        down[r], down[rows + r], down[2 * rows + r], down[3 * rows + r]);
#endif
}
