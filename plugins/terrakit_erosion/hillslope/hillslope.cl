// Creep of hillslopes in integer heights. Twin of reference.py.
//
// Every flux is rounded to whole quanta and is the exact negative of the flux seen from the
// other side. Beyond a closed border lies a mirror: the offset to a neighbour that is not there is
// 0 along that axis; beyond an open or a fixed one the slope goes on.
// HILLSLOPE_VARIED: the rate of creep differs from cell to cell (rate[] instead of 1).
// HILLSLOPE_LAYERED: a cell gives only a share of it (weight[]).

#define INLINE __attribute__((always_inline)) inline
#define CLOSED 0
#define OPEN 1
#define FIXED 2
// Largest square of the slope, relative to the critical one: creep is up to 10 times as fast.
#define STEEPEST 0.9f

// Works on the cells of a work-item, a row on processors and else one: INNER(i) inside the map, in
// a loop without branches, EDGE(i, row, col) on its border. The offset to the east is 1, the number
// of dimensions of a launch by rows: if the compiler knew it, it would carry what it read from one
// cell to the next, and the loop would no longer be one of vectors.
#ifdef TERRAKIT_CPU
#define HILLSLOPE_EACH(INNER, EDGE) \
    const int row = (int)get_global_id(0); \
    if (row >= rows) return; \
    const int inside = row > 0 && row < rows - 1; \
    const int east = (int)get_work_dim(); \
    if (inside) { \
        _Pragma("clang loop vectorize(assume_safety)") \
        for (int i = row * cols + 1; i < row * cols + cols - 1; ++i) { \
            INNER(i); \
        } \
    } \
    for (int col = 0; col < cols; col += inside && cols > 1 ? cols - 1 : 1) { \
        EDGE(row * cols + col, row, col); \
    }
#else
#define HILLSLOPE_EACH(INNER, EDGE) \
    const int col = (int)get_global_id(0); \
    const int row = (int)get_global_id(1); \
    if (col >= cols || row >= rows) return; \
    const int east = 1; \
    if (row > 0 && row < rows - 1 && col > 0 && col < cols - 1) { \
        const int i = row * cols + col; \
        INNER(i); \
    } else { \
        EDGE(row * cols + col, row, col); \
    }
#endif
// Offsets to the neighbours of a cell on the border.
#define UP (row > 0 ? -cols : 0)
#define DOWN (row < rows - 1 ? cols : 0)
#define LEFT (col > 0 ? -1 : 0)
#define RIGHT (col < cols - 1 ? 1 : 0)

// The sum of FLUX(j, diagonal) over the eight neighbours.
#define ALL_EIGHT(FLUX, up, down, left, right) \
    (FLUX(i + (up) + (left), 1) + FLUX(i + (up), 0) + FLUX(i + (up) + (right), 1) \
        + FLUX(i + (left), 0) + FLUX(i + (right), 0) \
        + FLUX(i + (down) + (left), 1) + FLUX(i + (down), 0) + FLUX(i + (down) + (right), 1))

#ifdef HILLSLOPE_VARIED
#define RATE(i, j) (0.5f * (rate[i] + rate[j]))
#else
#define RATE(i, j) 1.0f
#endif

// How far a cell lies below the one behind it, seen from one side of the map, over which material
// leaves down the slope that goes on beyond; no slope where the cell is not on that side.
INLINE int hillslope_outward(
    __global const int *height, int side, int i, int row, int col, int rows, int cols)
{
    const int at = side == 0 ? row == 0
        : (side == 1 ? row == rows - 1 : (side == 2 ? col == 0 : col == cols - 1));
    const int inward = side == 0 ? cols : (side == 1 ? -cols : (side == 2 ? 1 : -1));
    const int d = at ? height[i + inward] - height[i] : 0;
    return d > 0 ? d : 0;
}

// Writes the new height, and lowers the bedrock where the ground falls below it.
INLINE void hillslope_settle(
    __global const int *height, __global int *result, __global int *bed, int i, int out)
{
    const int after = height[i] - out;
    result[i] = after;
    bed[i] = bed[i] < after ? bed[i] : after;
}

// How much faster than on flat ground soil creeps (Roering 1999), from the mean of the squares of
// the slopes on either side; steepness is the slope of one quantum, relative to the critical one.
INLINE float hillslope_hastened(
    __global const int *height, float base, float steepness, int i, int up, int down, int left,
    int right)
{
    const int z = height[i];
    const float n = (float)(height[i + up] - z) * steepness;
    const float s = (float)(height[i + down] - z) * steepness;
    const float w = (float)(height[i + left] - z) * steepness;
    const float e = (float)(height[i + right] - z) * steepness;
    const float square = 0.5f * ((n * n + s * s) + (w * w + e * e));
    return base / (1.0f - (square < STEEPEST ? square : STEEPEST));
}

__kernel void hillslope_hasten(
    __global const int *restrict height,
    __global const float *restrict base,
    __global float *restrict rate,
    const float steepness,
    const int border,
    const int rows,
    const int cols)
{
#define INNER(i) \
    rate[i] = hillslope_hastened(height, base[i], steepness, i, -cols, cols, -east, east)
    // Beyond a border that lets material through the slope is that to the cell behind
#define EDGE(i, row, col) \
    const int goes_on = border != CLOSED; \
    rate[i] = hillslope_hastened(height, base[i], steepness, i, \
        row > 0 ? -cols : (goes_on ? cols : 0), row < rows - 1 ? cols : (goes_on ? -cols : 0), \
        col > 0 ? -1 : (goes_on ? 1 : 0), col < cols - 1 ? 1 : (goes_on ? -1 : 0))
    HILLSLOPE_EACH(INNER, EDGE)
#undef INNER
#undef EDGE
}

INLINE float hillslope_wanted(
    __global const int *height, __global const float *rate, int i, int j, float share)
{
    return share * RATE(i, j) * (float)(height[i] - height[j]);
}

INLINE int hillslope_downhill(float flux)
{
    return (int)(flux > 0.0f ? flux + 0.5f : 0.0f);
}

// The share of what would creep out of a cell that it gives: what its loose material can supply,
// or, if that is more, what its bedrock allows.
__kernel void hillslope_hold(
    __global const int *restrict height,
    __global const int *restrict bed,
    __global const float *restrict rate,
    __global const float *restrict softness,
    __global float *restrict weight,
    const float axial,
    const float diagonal,
    const int border,
    const int rows,
    const int cols)
{
#define FLUX(j, slanted) \
    hillslope_downhill(hillslope_wanted(height, rate, i, j, slanted ? diagonal : axial))
#define HOLD(out) \
    const float wanted = (float)((out) + 16); \
    const float there = (float)(height[i] - bed[i]); \
    const float supplied = there < wanted ? there / wanted * 0.99999905f : 1.0f; \
    const float soft = softness[i]; \
    weight[i] = supplied > soft ? supplied : soft
#define INNER(i) HOLD(ALL_EIGHT(FLUX, -cols, cols, -east, east))
#define EDGE(at, row, col) \
    const int i = at; \
    int out = ALL_EIGHT(FLUX, UP, DOWN, LEFT, RIGHT); \
    for (int side = 0; border == OPEN && side < 4; ++side) { \
        const float d = (float)hillslope_outward(height, side, i, row, col, rows, cols); \
        out += hillslope_downhill(axial * RATE(i, i) * d) \
            + 2 * hillslope_downhill(diagonal * RATE(i, i) * d); \
    } \
    HOLD(out)
    HILLSLOPE_EACH(INNER, EDGE)
#undef FLUX
#undef HOLD
#undef INNER
#undef EDGE
}

// What is given of a flux, in whole quanta: the nearest to all of it, and of less no more than that.
INLINE int hillslope_given(
    __global const int *height, __global const float *weight, int i, int j, float flux)
{
    const float nearest = flux < 0.0f ? -0.5f : 0.5f;
#ifdef HILLSLOPE_LAYERED
    const float own = weight[i];
    const float other = weight[j];
    const float share = height[i] > height[j] ? own : other;
    return (int)(share * flux + (share < 1.0f ? 0.0f : nearest));
#else
    return (int)(flux + nearest);
#endif
}

// One sweep of creep.
__kernel void hillslope_creep(
    __global const int *restrict height,
    __global int *restrict result,
    __global int *restrict bed,
    __global const float *restrict rate,
    __global const float *restrict weight,
    __global long *restrict exported,
    const float axial,
    const float diagonal,
    const int border,
    const int rows,
    const int cols)
{
#define GIVEN(j, flux) hillslope_given(height, weight, i, j, flux)
#define FLUX(j, slanted) \
    GIVEN(j, hillslope_wanted(height, rate, i, j, slanted ? diagonal : axial))
#define INNER(i) \
    hillslope_settle(height, result, bed, i, ALL_EIGHT(FLUX, -cols, cols, -east, east))
#define EDGE(at, row, col) \
    const int i = at; \
    const int longest = rows > cols ? rows : cols; \
    int out = ALL_EIGHT(FLUX, UP, DOWN, LEFT, RIGHT); \
    for (int side = 0; border == OPEN && side < 4; ++side) { \
        const float d = (float)hillslope_outward(height, side, i, row, col, rows, cols); \
        const int leaving = GIVEN(i, axial * RATE(i, i) * d) \
            + 2 * GIVEN(i, diagonal * RATE(i, i) * d); \
        if (leaving) exported[side * longest + (side < 2 ? col : row)] += leaving; \
        out += leaving; \
    } \
    if (border == FIXED) { \
        const int side = row == 0 ? 0 : (row == rows - 1 ? 1 : (col == 0 ? 2 : 3)); \
        exported[side * longest + (side < 2 ? col : row)] -= out; \
        out = 0; \
    } \
    hillslope_settle(height, result, bed, i, out)
    HILLSLOPE_EACH(INNER, EDGE)
#undef GIVEN
#undef FLUX
#undef INNER
#undef EDGE
}
