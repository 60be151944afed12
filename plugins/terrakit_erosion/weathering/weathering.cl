// Weathering in integer heights. Twin of reference.py.
//
// Beyond the border of the map lies a mirror: the offset to a neighbour that is not there is 0.

// The largest that steep faces and sharp edges count: faces 4 times, edges 9 times.
#define STEEPEST 15.0f
#define SHARPEST 8.0f
// Thickest debris, quanta.
#define DEEPEST 1073741824

__attribute__((always_inline)) inline float weathering_exposed(
    __global const int *height, float steepness, float sharpness, int i, int up, int down,
    int left, int right)
{
    const int z = height[i];
    const float n = (float)(z - height[i + up]);
    const float s = (float)(z - height[i + down]);
    const float w = (float)(z - height[i + left]);
    const float e = (float)(z - height[i + right]);
    const float nw = (float)(z - height[i + up + left]);
    const float ne = (float)(z - height[i + up + right]);
    const float sw = (float)(z - height[i + down + left]);
    const float se = (float)(z - height[i + down + right]);
    const float square = steepness * ((n * n + s * s) + (w * w + e * e));
    const float face = 1.0f + (square < STEEPEST ? square : STEEPEST);
    const float convex = sharpness
        * (4.0f * ((n + s) + (w + e)) + ((nw + se) + (ne + sw)));
    const float edge = convex < SHARPEST ? convex : SHARPEST;
    return exact_power(face, 0.5f) * (1.0f + (edge > 0.0f ? edge : 0.0f));
}

// Natural logarithm of 1 + q.
__attribute__((always_inline)) inline float weathering_logarithm(float q)
{
    const float series = q * (1.0f - q * (0.5f - q * 0.333333333f));
    const float whole = exact_log2(1.0f + q) * 0.69314718f;
    return q < 0.01f ? series : whole;
}

// How much bedrock turns to debris in a step, quanta.
// rate: depth of bare, flat rock that does, quanta. shield: exponent of 2 by which a quantum of
// cover slows it. hump: 0 where bare rock is fastest, else B of 4 B y (1 - B y).
// depth: debris over which production falls by e, quanta of rock. deepest: the most in a step.
// carried: what was due before and is less than a quantum.
__kernel void weathering_produce(
    __global const int *restrict height,
    __global const int *restrict bed,
    __global const float *restrict rate,
    __global float *restrict carried,
    __global int *restrict produced,
    const float steepness,
    const float sharpness,
    const float shield,
    const float hump,
    const float depth,
    const float deepest,
    const int rows,
    const int cols)
{
#define PRODUCE(i, up, down, left, right) { \
    const int cover = height[i] - bed[i]; \
    const float y = exact_exp2(shield * (float)cover); \
    const float by = hump * y; \
    const float covered = hump > 0.0f ? 4.0f * by * (1.0f - by) : y; \
    const float exposed = \
        weathering_exposed(height, steepness, sharpness, i, up, down, left, right); \
    const float wanted = rate[i] * exposed * covered / depth; \
    const float q = wanted < 1e30f ? wanted : 1e30f; \
    const float gained = depth * weathering_logarithm(q); \
    const float limited = gained < deepest ? gained : deepest; \
    const float due = carried[i] + (cover < DEEPEST ? limited : 0.0f); \
    const int whole = (int)due; \
    carried[i] = due - (float)whole; \
    produced[i] = whole; }
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    const int inside = row > 0 && row < rows - 1;
    const int east = (int)get_work_dim();  // 1, which the compiler must not know; see thermal.cl
    if (inside) {
        _Pragma("clang loop vectorize(assume_safety)")
        for (int i = row * cols + 1; i < row * cols + cols - 1; ++i) {
            PRODUCE(i, -cols, cols, -east, east)
        }
    }
    for (int col = 0; col < cols; col += inside && cols > 1 ? cols - 1 : 1) {
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    {
#endif
        const int i = row * cols + col;
        PRODUCE(i, row > 0 ? -cols : 0, row < rows - 1 ? cols : 0, col > 0 ? -1 : 0,
            col < cols - 1 ? 1 : 0)
    }
}

// Turns what was produced into debris, which takes more room than the rock did.
__kernel void weathering_loosen(
    __global int *restrict height,
    __global int *restrict bed,
    __global long *restrict swollen,
    __global const int *restrict produced,
    const float swelling,
    const int count)
{
    const int i = (int)get_global_id(0);
    if (i >= count) return;
    const int swell = (int)(swelling * (float)produced[i]);
    bed[i] -= produced[i];
    height[i] += swell;
    swollen[i] += swell;
}
