// Thin-plate relaxation of terraces within half a step. Twin of reference.py.
//
// Differences to the two neighbours on opposite sides are added first, then pair to pair: the sum is
// the same however the terrain is turned. A pair of which one lies outside counts as straight.

// Mean height of the eight neighbours, stride samples away, above the point itself.
__attribute__((always_inline)) inline float dequantise_above(
    __global const float *values, int row, int col, int rows, int cols, int stride)
{
    const int i = row * cols + col;
    const int dy = row >= stride && row < rows - stride ? stride * cols : 0;
    const int dx = col >= stride && col < cols - stride ? stride : 0;
    const int falling = dy != 0 && dx != 0 ? dy + dx : 0;
    const int rising = dy != 0 && dx != 0 ? dy - dx : 0;
    const float here = values[i];
    const float down = (values[i - dy] - here) + (values[i + dy] - here);
    const float across = (values[i - dx] - here) + (values[i + dx] - here);
    const float first = (values[i - falling] - here) + (values[i + falling] - here);
    const float second = (values[i - rising] - here) + (values[i + rising] - here);
    return (2.0f * (down + across) + (first + second)) * 0.083333336f;
}

__attribute__((always_inline)) inline int dequantise_is_near(float a, float b, float limit)
{
    const float gap = a - b;
    return (gap < 0.0f ? -gap : gap) <= limit;
}

// Whether the terrace, or the one beside it, reaches stride samples to every side.
__attribute__((always_inline)) inline int dequantise_is_wide(
    __global const float *start, int row, int col, int rows, int cols, int stride,
    float limit)
{
    const int i = row * cols + col;
    const float here = start[i];
    return dequantise_is_near(start[row >= stride ? i - stride * cols : i], here, limit) &
        dequantise_is_near(start[row < rows - stride ? i + stride * cols : i], here, limit) &
        dequantise_is_near(start[col >= stride ? i - stride : i], here, limit) &
        dequantise_is_near(start[col < cols - stride ? i + stride : i], here, limit);
}

__attribute__((always_inline)) inline float dequantise_relaxed(
    __global const float *height, __global const float *bend,
    __global const float *start, int row, int col, int rows, int cols, int stride,
    float limit, float half_step)
{
    const int i = row * cols + col;
    const float wanted =
        height[i] - 0.55f * dequantise_above(bend, row, col, rows, cols, stride);
    const float low = start[i] - half_step;
    const float high = start[i] + half_step;
    const float bounded = wanted < low ? low : (wanted > high ? high : wanted);
    return dequantise_is_wide(start, row, col, rows, cols, stride, limit) ? bounded : height[i];
}

// How far the ground bends at every sample.
__kernel void dequantise_bend(
    __global float *bend, __global const float *height,
    const int stride, const int rows, const int cols)
{
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int col = 0; col < cols; ++col) {
        bend[row * cols + col] = dequantise_above(height, row, col, rows, cols, stride);
    }
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    bend[row * cols + col] = dequantise_above(height, row, col, rows, cols, stride);
#endif
}

// Let a thin plate straighten itself a little, no further than half a step from the data.
__kernel void dequantise_relax(
    __global float *result, __global const float *height,
    __global const float *bend, __global const float *start,
    const float limit, const float half_step, const int stride, const int rows, const int cols)
{
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int col = 0; col < cols; ++col) {
        result[row * cols + col] = dequantise_relaxed(
            height, bend, start, row, col, rows, cols, stride, limit, half_step);
    }
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    result[row * cols + col] = dequantise_relaxed(
        height, bend, start, row, col, rows, cols, stride, limit, half_step);
#endif
}
