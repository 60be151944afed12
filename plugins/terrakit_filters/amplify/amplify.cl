// Refinement of a terrain by measured innovations. Twin of reference.py.
//
// A level doubles the samples in two turns: centres of cells, then middles of edges, by the same
// stencil turned by 45 degrees. Heights are taken relative to one neighbour, so that level ground
// stays level to the last bit.
// AMPLIFY_MEAN: guess from the four nearest points alone (Fournier 1982, Miller 1986) instead of
// the sixteen nearest.
// level: terrain, one coarser than what is made: a cell of the terrain is 1 << level cells here.
// Heights begin MARGIN samples outside the terrain, as do strength and still.

#define AMPLIFY_MARGIN 6

// Guess from four near points, eight further ones and four far ones: sums of their heights above a
// neighbour.
__attribute__((always_inline)) inline float amplify_guess(
    float base, float near, float further, float far)
{
#ifdef AMPLIFY_MEAN
    return base + 0.25f * near;
#else
    return base + ((0.3359375f * near - 0.0546875f * further) + 0.0234375f * far);
#endif
}

// Share of the measured deviation at a point half a step between points, by the terrain's samples.
__attribute__((always_inline)) inline float amplify_strength(
    __global const float *strength, int row, int col, int level, int stride)
{
    const int finer = level + 1;
    const int mask = (1 << finer) - 1;
    const float part = 1.0f / (float)(1 << finer);
    const int i = ((row >> finer) + AMPLIFY_MARGIN) * stride + (col >> finer) + AMPLIFY_MARGIN;
    const float x = (float)(col & mask) * part;
    const float y = (float)(row & mask) * part;
    const float north = strength[i] + x * (strength[i + 1] - strength[i]);
    const float south =
        strength[i + stride] + x * (strength[i + stride + 1] - strength[i + stride]);
    return north + y * (south - north);
}

// Whether the cell of the terrain in which a cell of this level lies stays as it is.
__attribute__((always_inline)) inline int amplify_still(
    __global const uchar *still, int row, int col, int level, int stride)
{
    return still[((row >> level) + AMPLIFY_MARGIN) * stride + (col >> level) + AMPLIFY_MARGIN];
}

__attribute__((always_inline)) inline float amplify_innovation(
    float deviation, uint low, uint high, int col, int row)
{
    return deviation * exact_normal(exact_hash(low, high, col, row));
}

__attribute__((always_inline)) inline void amplify_one_centre(
    __global float *centre, __global const float *height,
    __global const float *strength, __global const uchar *still,
    uint low, uint high, float deviation, int first_row, int first_col, int level,
    int r, int c, int cols, int width, int stride)
{
    const int i = (r + 1) * width + c + 1;
    const float base = height[i];
    const float east = height[i + 1] - base;
    const float south = height[i + width] - base;
    const float across = height[i + width + 1] - base;
    const float near = east + south + across;
    const float further =
        ((height[i - width] - base) + (height[i - width + 1] - base)) +
        ((height[i + 2 * width] - base) + (height[i + 2 * width + 1] - base)) +
        (((height[i - 1] - base) + (height[i + width - 1] - base)) +
         ((height[i + 2] - base) + (height[i + width + 2] - base)));
    const float far =
        ((height[i - width - 1] - base) + (height[i + 2 * width + 2] - base)) +
        ((height[i - width + 2] - base) + (height[i + 2 * width - 1] - base));
    const int row = r + 1 - AMPLIFY_MARGIN;
    const int col = c + 1 - AMPLIFY_MARGIN;
    const float share = amplify_strength(strength, 2 * row + 1, 2 * col + 1, level, stride);
    const float lively = amplify_guess(base, near, further, far) + share * amplify_innovation(
        deviation, low, high, (int)((uint)first_col + 2u * (uint)col + 1u),
        (int)((uint)first_row + 2u * (uint)row + 1u));
    centre[r * cols + c] =
        amplify_still(still, row, col, level, stride) ? base + 0.25f * near : lively;
}

// Centres of the cells from 1, 1 on. first_row, first_col: world index, in the finer samples, of the
// terrain's first one. cols: of the centres; width: of height; stride: of strength and still.
__kernel void amplify_centre(
    __global float *centre, __global const float *height,
    __global const float *strength, __global const uchar *still,
    const uint low, const uint high, const float deviation,
    const int first_row, const int first_col, const int level,
    const int rows, const int cols, const int width, const int stride)
{
#ifdef TERRAKIT_CPU
    const int r = (int)get_global_id(0);
    if (r >= rows) return;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int c = 0; c < cols; ++c) {
        amplify_one_centre(centre, height, strength, still, low, high, deviation,
                           first_row, first_col, level, r, c, cols, width, stride);
    }
#else
    const int c = (int)get_global_id(0);
    const int r = (int)get_global_id(1);
    if (c >= cols || r >= rows) return;
    amplify_one_centre(centre, height, strength, still, low, high, deviation,
                       first_row, first_col, level, r, c, cols, width, stride);
#endif
}

// Middle of the edge between two points: along is the step from one to the other, aside the step
// across it; before, after: the centres on both sides and the steps between centres.
__attribute__((always_inline)) inline float amplify_edge(
    __global const float *height, __global const float *centre,
    int i, int along, int aside, int k, int centre_along, int centre_aside,
    float innovation, int stays)
{
    const float base = height[i];
    const float end = height[i + along] - base;
    const float near = end + ((centre[k - centre_aside] - base) + (centre[k] - base));
    const float further =
        ((height[i - aside] - base) + (height[i + along - aside] - base)) +
        ((height[i + aside] - base) + (height[i + along + aside] - base)) +
        (((centre[k - centre_aside - centre_along] - base) +
          (centre[k - centre_aside + centre_along] - base)) +
         ((centre[k - centre_along] - base) + (centre[k + centre_along] - base)));
    const float far =
        ((height[i - along] - base) + (height[i + 2 * along] - base)) +
        ((centre[k - 2 * centre_aside] - base) + (centre[k + centre_aside] - base));
    return stays ? base + 0.5f * end : amplify_guess(base, near, further, far) + innovation;
}

__attribute__((always_inline)) inline void amplify_one_square(
    __global float *fine, __global const float *height,
    __global const float *centre,
    __global const float *strength, __global const uchar *still,
    uint low, uint high, float deviation, int first_row, int first_col, int level,
    int r, int c, int cols, int width, int stride)
{
    const int i = (r + 3) * width + c + 3;
    const int middles = cols + 3;
    const int k = (r + 2) * middles + c + 2;
    const int out = 4 * r * cols + 2 * c;
    const int row = r + 3 - AMPLIFY_MARGIN;
    const int col = c + 3 - AMPLIFY_MARGIN;
    const int here = amplify_still(still, row, col, level, stride);
    const int above = amplify_still(still, row - 1, col, level, stride);
    const int left = amplify_still(still, row, col - 1, level, stride);
    const int y = (int)((uint)first_row + 2u * (uint)row);
    const int x = (int)((uint)first_col + 2u * (uint)col);
    const float across = amplify_strength(strength, 2 * row, 2 * col + 1, level, stride) *
        amplify_innovation(deviation, low, high, (int)((uint)x + 1u), y);
    const float down = amplify_strength(strength, 2 * row + 1, 2 * col, level, stride) *
        amplify_innovation(deviation, low, high, x, (int)((uint)y + 1u));
    fine[out] = height[i];
    fine[out + 1] = amplify_edge(
        height, centre, i, 1, width, k, 1, middles, across, here | above);
    fine[out + 2 * cols] = amplify_edge(
        height, centre, i, width, 1, k, middles, 1, down, here | left);
    fine[out + 2 * cols + 1] = centre[k];
}

// The finer samples of the points from 3, 3 on: rows by cols of them get four each.
__kernel void amplify_square(
    __global float *fine, __global const float *height,
    __global const float *centre,
    __global const float *strength, __global const uchar *still,
    const uint low, const uint high, const float deviation,
    const int first_row, const int first_col, const int level,
    const int rows, const int cols, const int width, const int stride)
{
#ifdef TERRAKIT_CPU
    const int r = (int)get_global_id(0);
    if (r >= rows) return;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int c = 0; c < cols; ++c) {
        amplify_one_square(fine, height, centre, strength, still, low, high, deviation,
                           first_row, first_col, level, r, c, cols, width, stride);
    }
#else
    const int c = (int)get_global_id(0);
    const int r = (int)get_global_id(1);
    if (c >= cols || r >= rows) return;
    amplify_one_square(fine, height, centre, strength, still, low, high, deviation,
                       first_row, first_col, level, r, c, cols, width, stride);
#endif
}

// Cut the margin away.
__kernel void amplify_cut(
    __global float *elevation, __global const float *height,
    const int rows, const int cols, const int width)
{
    const int c = (int)get_global_id(0);
    const int r = (int)get_global_id(1);
    if (c >= cols || r >= rows) return;
    elevation[(size_t)r * cols + c] =
        height[(size_t)(r + AMPLIFY_MARGIN) * width + c + AMPLIFY_MARGIN];
}
