// Thermal erosion in integer heights. Twin of reference.py.
//
// Every flux is truncated to whole quanta and is the exact negative of the flux seen from the
// other side, so nothing is lost and the order of additions does not matter. Beyond a closed
// border lies a mirror: the offset to a neighbour that is not there is 0 along that axis.
// THERMAL_TALUS_FIELD: the talus slope varies from cell to cell (talus[] instead of one number).
// THERMAL_LAYERED: the kernels in which loose material and the bedrock under it have an angle each.

#define INLINE __attribute__((always_inline)) inline

// Talus of the upper of two cells; both are read, or the loop would not be one of vectors.
INLINE int thermal_upper(__global const int *talus, int i, int j, int upper_is_i)
{
#ifdef THERMAL_TALUS_FIELD
    const int own = talus[i];
    const int other = talus[j];
    return upper_is_i ? own : other;
#else
    return talus[0];
#endif
}

// Works on the cells of a work-item, a row on processors and else one: INNER(i) inside the map, in
// a loop without branches, EDGE(i, row, col) on its border. The offset to the east is 1, the number
// of dimensions of a launch by rows: if the compiler knew it, it would carry what it read from one
// cell to the next, and the loop would no longer be one of vectors.
#ifdef TERRAKIT_CPU
#define THERMAL_EACH(INNER, EDGE) \
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
#define THERMAL_EACH(INNER, EDGE) \
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

// Height beyond the talus between two points whose heights differ by d.
INLINE int thermal_excess(int d, int limit)
{
    const int down = d - limit;
    const int up = -d - limit;
    return (down > 0 ? down : 0) - (up > 0 ? up : 0);
}

// Height beyond the talus, downward only.
INLINE int thermal_beyond(int d, int limit)
{
    const int e = d - limit;
    return e > 0 ? e : 0;
}

// Talus of a diagonal neighbour, sqrt(2) further away.
INLINE int thermal_diagonal(int axial)
{
    return (int)((float)axial * 1.41421356f);
}

// Slope (tangent) as a difference of heights, quanta.
INLINE int thermal_limit_of(float repose, float scale)
{
    const float limit = repose * scale;
    return (int)(limit < 536870912.0f ? limit : 536870912.0f);
}

// How far a cell lies below the one behind it, seen from one side of the map, over which material
// leaves down the slope that goes on beyond; no slope where the cell is not on that side.
INLINE int thermal_outward(
    __global const int *height, int side, int i, int row, int col, int rows, int cols)
{
    const int at = side == 0 ? row == 0
        : (side == 1 ? row == rows - 1 : (side == 2 ? col == 0 : col == cols - 1));
    const int inward = side == 0 ? cols : (side == 1 ? -cols : (side == 2 ? 1 : -1));
    return at ? height[i + inward] - height[i] : -2147483647;
}

// Writes the new height, and lowers the bedrock where the ground falls below it.
INLINE void thermal_settle(
    __global const int *height, __global int *result, __global int *bed, int i, int out)
{
    const int after = height[i] - out;
    result[i] = after;
    bed[i] = bed[i] < after ? bed[i] : after;
}

// The sum of FLUX(j, diagonal) over the eight neighbours.
#define ALL_EIGHT(FLUX, up, down, left, right) \
    (FLUX(i + (up) + (left), 1) + FLUX(i + (up), 0) + FLUX(i + (up) + (right), 1) \
        + FLUX(i + (left), 0) + FLUX(i + (right), 0) \
        + FLUX(i + (down) + (left), 1) + FLUX(i + (down), 0) + FLUX(i + (down) + (right), 1))

INLINE int thermal_higher(int a, int b) { return a > b ? a : b; }

// Proportional form (Olsen 2004, Jako & Toth 2011; sheet S2): how much of each excess a cell gives
// away, so that its largest excess shrinks by the share. Sums are whole numbers, and of two kinds,
// so that they do not overflow and have no order.
INLINE float thermal_proportion(
    __global const int *height, int talus, int i, int cols, float share, int *largest)
{
    const int slanted = thermal_diagonal(talus);
    const int z = height[i];
    const int n = thermal_beyond(z - height[i - cols], talus);
    const int s = thermal_beyond(z - height[i + cols], talus);
    const int w = thermal_beyond(z - height[i - 1], talus);
    const int e = thermal_beyond(z - height[i + 1], talus);
    const int nw = thermal_beyond(z - height[i - cols - 1], slanted);
    const int ne = thermal_beyond(z - height[i - cols + 1], slanted);
    const int sw = thermal_beyond(z - height[i + cols - 1], slanted);
    const int se = thermal_beyond(z - height[i + cols + 1], slanted);
    const int straight_most = thermal_higher(thermal_higher(n, s), thermal_higher(w, e));
    const int slanted_most = thermal_higher(thermal_higher(nw, ne), thermal_higher(sw, se));
    const int most = thermal_higher(straight_most, slanted_most);
    const float total = (float)((uint)n + (uint)s + (uint)w + (uint)e)
        + (float)((uint)nw + (uint)ne + (uint)sw + (uint)se);
    *largest = most;
    return total > 0.0f ? share * (float)most / (total > 0.0f ? total : 1.0f) : 0.0f;
}

// The same on the border, with what leaves over it where it is open.
inline float thermal_proportion_at_edge(
    __global const int *height, int talus, int row, int col, int rows, int cols, float share,
    int open, int *largest)
{
    const int i = row * cols + col;
    const int slanted = thermal_diagonal(talus);
    int most = 0;
    uint straight_sum = 0u, slanted_sum = 0u, straight_out = 0u, slanted_out = 0u;
    for (int dr = -1; dr <= 1; ++dr) {
        for (int dc = -1; dc <= 1; ++dc) {
            if (dr == 0 && dc == 0) continue;
            const int j = i + (dr < 0 ? UP : (dr > 0 ? DOWN : 0))
                + (dc < 0 ? LEFT : (dc > 0 ? RIGHT : 0));
            const int is_slanted = dr != 0 && dc != 0;
            const int e = thermal_beyond(height[i] - height[j], is_slanted ? slanted : talus);
            most = thermal_higher(most, e);
            straight_sum += is_slanted ? 0u : (uint)e;
            slanted_sum += is_slanted ? (uint)e : 0u;
        }
    }
    for (int side = 0; open && side < 4; ++side) {
        const int d = thermal_outward(height, side, i, row, col, rows, cols);
        if (d <= 0) continue;
        const int e = thermal_beyond(d, talus);
        most = thermal_higher(most, e);
        straight_out += (uint)e;
        slanted_out += (uint)thermal_beyond(d, slanted);
    }
    const float total = ((float)straight_sum + (float)slanted_sum)
        + ((float)straight_out + 2.0f * (float)slanted_out);
    *largest = most;
    return total > 0.0f ? share * (float)most / total : 0.0f;
}

#ifndef THERMAL_LAYERED

// What leaves through the open borders at a cell, down the slope that goes on beyond them.
inline int thermal_leaving(
    __global const int *height, __global long *exported, int row, int col, int rows, int cols,
    int talus, float axial, float diagonal)
{
    const int i = row * cols + col;
    int sum = 0;
    for (int side = 0; side < 4; ++side) {
        const int d = thermal_outward(height, side, i, row, col, rows, cols);
        if (d <= 0) continue;
        const int leaving = (int)(axial * (float)thermal_beyond(d, talus))
            + 2 * (int)(diagonal * (float)thermal_beyond(d, thermal_diagonal(talus)));
        exported[side * (rows > cols ? rows : cols) + (side < 2 ? col : row)] += leaving;
        sum += leaving;
    }
    return sum;
}

INLINE int thermal_flux(
    __global const int *height, __global const int *talus, int i, int j, int diagonal, float share)
{
    const int d = height[i] - height[j];
    const int axial = thermal_upper(talus, i, j, d > 0);
    const int limit = diagonal ? thermal_diagonal(axial) : axial;
    return (int)(share * (float)thermal_excess(d, limit));
}

// One sweep of the flux form (Musgrave 1989; sheet S1).
__kernel void thermal_relax(
    __global const int *restrict height,
    __global int *restrict result,
    __global int *restrict bed,
    __global const int *restrict talus,
    __global long *restrict exported,
    const float axial,
    const float diagonal,
    const int open,
    const int rows,
    const int cols)
{
#define FLUX(j, slanted) thermal_flux(height, talus, i, j, slanted, slanted ? diagonal : axial)
#define INNER(i) \
    thermal_settle(height, result, bed, i, ALL_EIGHT(FLUX, -cols, cols, -east, east))
#define EDGE(at, row, col) \
    const int i = at; \
    int out = ALL_EIGHT(FLUX, UP, DOWN, LEFT, RIGHT); \
    if (open) { \
        out += thermal_leaving( \
            height, exported, row, col, rows, cols, thermal_upper(talus, i, i, 1), axial, diagonal); \
    } \
    thermal_settle(height, result, bed, i, out)
    THERMAL_EACH(INNER, EDGE)
#undef FLUX
#undef INNER
#undef EDGE
}

// Proportional form, pass 1.
__kernel void thermal_weigh(
    __global const int *restrict height,
    __global float *restrict weight,
    __global const int *restrict talus,
    const float share,
    const int open,
    const int rows,
    const int cols)
{
    int most;
#define INNER(i) \
    int largest; \
    weight[i] = thermal_proportion(height, thermal_upper(talus, i, i, 1), i, cols, share, &largest)
#define EDGE(i, row, col) \
    weight[i] = thermal_proportion_at_edge( \
        height, thermal_upper(talus, i, i, 1), row, col, rows, cols, share, open, &most)
    THERMAL_EACH(INNER, EDGE)
#undef INNER
#undef EDGE
}

INLINE int thermal_given(
    __global const int *height, __global const float *weight, __global const int *talus, int i,
    int j, int diagonal)
{
    const int d = height[i] - height[j];
    const int axial = thermal_upper(talus, i, j, d > 0);
    const int e = thermal_excess(d, diagonal ? thermal_diagonal(axial) : axial);
    const float own = weight[i];
    const float other = weight[j];
    return (int)((e > 0 ? own : other) * (float)e);
}

// Proportional form, pass 2: give and take.
__kernel void thermal_share(
    __global const int *restrict height,
    __global int *restrict result,
    __global int *restrict bed,
    __global const float *restrict weight,
    __global const int *restrict talus,
    __global long *restrict exported,
    const int open,
    const int rows,
    const int cols)
{
#define FLUX(j, slanted) thermal_given(height, weight, talus, i, j, slanted)
#define INNER(i) \
    thermal_settle(height, result, bed, i, ALL_EIGHT(FLUX, -cols, cols, -east, east))
#define EDGE(at, row, col) \
    const int i = at; \
    int out = ALL_EIGHT(FLUX, UP, DOWN, LEFT, RIGHT); \
    if (open) { \
        out += thermal_leaving( \
            height, exported, row, col, rows, cols, thermal_upper(talus, i, i, 1), weight[i], weight[i]); \
    } \
    thermal_settle(height, result, bed, i, out)
    THERMAL_EACH(INNER, EDGE)
#undef FLUX
#undef INNER
#undef EDGE
}

// One sweep on the edge graph of a mesh (sheet M1). Volumes are 64-bit quanta; heights follow
// from them through the area of the vertex.
__kernel void thermal_relax_mesh(
    __global const int *height,
    __global int *result,
    __global int *bed,
    __global long *volume,
    __global const int *base,
    __global const float *slope,
    __global const int *start,
    __global const int *neighbor,
    __global const float *length,
    __global const float *conductance,
    __global const float *height_a_volume,
    const int count)
{
    const int i = (int)get_global_id(0);
    if (i >= count) return;
    long sum = 0;
    for (int k = start[i]; k < start[i + 1]; ++k) {
        const int j = neighbor[k];
        const int d = height[i] - height[j];
        const int limit = thermal_limit_of(d > 0 ? slope[i] : slope[j], length[k]);
        sum += (long)(conductance[k] * (float)thermal_excess(d, limit));
    }
    const long total = volume[i] - sum;
    volume[i] = total;
    const int after = base[i] + (int)((float)total * height_a_volume[i]);
    result[i] = after;
    bed[i] = bed[i] < after ? bed[i] : after;
}

#else

// The share of what a cell wants to give that it has, so that it never gives more.
INLINE float thermal_supplied(int loose, int out)
{
    const float wanted = (float)(out + 16);
    const float there = (float)loose;
    return there < wanted ? there / wanted * 0.99999905f : 1.0f;
}

// Pass 1, flux form: which share of what would flow out of a cell, if all of it were loose, its
// loose material can supply.
__kernel void thermal_hold(
    __global const int *restrict height,
    __global const int *restrict bed,
    __global const int *restrict talus,
    __global float *restrict weight,
    const float axial,
    const float diagonal,
    const int open,
    const int rows,
    const int cols)
{
#define FLUX(j, slanted) \
    (int)((slanted ? diagonal : axial) * (float)thermal_beyond( \
        height[i] - height[j], slanted ? thermal_diagonal(talus[i]) : talus[i]))
#define INNER(i) \
    weight[i] = thermal_supplied( \
        height[i] - bed[i], ALL_EIGHT(FLUX, -cols, cols, -east, east))
#define EDGE(at, row, col) \
    const int i = at; \
    int out = ALL_EIGHT(FLUX, UP, DOWN, LEFT, RIGHT); \
    for (int side = 0; open && side < 4; ++side) { \
        const int d = thermal_outward(height, side, i, row, col, rows, cols); \
        if (d <= 0) continue; \
        out += (int)(axial * (float)thermal_beyond(d, talus[i])) + 2 * (int)(diagonal \
            * (float)thermal_beyond(d, thermal_diagonal(talus[i]))); \
    } \
    weight[i] = thermal_supplied(height[i] - bed[i], out)
    THERMAL_EACH(INNER, EDGE)
#undef FLUX
#undef INNER
#undef EDGE
}

// Pass 1, proportional form: the weights of loose material and of rock.
__kernel void thermal_hold_shares(
    __global const int *restrict height,
    __global const int *restrict bed,
    __global const int *restrict talus,
    __global const int *restrict rock,
    __global const float *restrict softness,
    __global float *restrict weight,
    __global float *restrict rock_weight,
    const float share,
    const int open,
    const int rows,
    const int cols)
{
#define WEIGH(PROPORTION) \
    int largest; \
    int rock_largest; \
    const float of_rock = PROPORTION(rock[i], &rock_largest); \
    const float loose = PROPORTION(talus[i], &largest); \
    weight[i] = loose * thermal_supplied(height[i] - bed[i], (int)(share * (float)largest)); \
    rock_weight[i] = softness[i] * of_rock
#define INSIDE(limit, largest) thermal_proportion(height, limit, i, cols, share, largest)
#define INNER(i) WEIGH(INSIDE)
#define AT_EDGE(limit, largest) \
    thermal_proportion_at_edge(height, limit, row, col, rows, cols, share, open, largest)
#define EDGE(at, row, col) \
    const int i = at; \
    WEIGH(AT_EDGE)
    THERMAL_EACH(INNER, EDGE)
#undef WEIGH
#undef INSIDE
#undef INNER
#undef AT_EDGE
#undef EDGE
}

// The larger of what loose material and of what the rock under it gives down a slope.
INLINE int thermal_larger(
    int steep, int diagonal, float share, int talus, int rock, float weight, float rock_weight)
{
    const int loose = thermal_beyond(steep, diagonal ? thermal_diagonal(talus) : talus);
    const int firm = thermal_beyond(steep, diagonal ? thermal_diagonal(rock) : rock);
    return thermal_higher(
        (int)(share * weight * (float)loose), (int)(share * rock_weight * (float)firm));
}

INLINE int thermal_slip(
    __global const int *height, __global const int *talus, __global const int *rock,
    __global const float *weight, __global const float *rock_weight, int i, int j, int diagonal,
    float share)
{
    const int d = height[i] - height[j];
    const int down = d > 0;
    const int loose_i = talus[i], loose_j = talus[j], rock_i = rock[i], rock_j = rock[j];
    const float w_i = weight[i], w_j = weight[j], v_i = rock_weight[i], v_j = rock_weight[j];
    const int flux = thermal_larger(down ? d : -d, diagonal, share, down ? loose_i : loose_j,
        down ? rock_i : rock_j, down ? w_i : w_j, down ? v_i : v_j);
    return down ? flux : -flux;
}

// Pass 2: give and take, where loose material and the bedrock under it have an angle each.
__kernel void thermal_slide(
    __global const int *restrict height,
    __global int *restrict result,
    __global int *restrict bed,
    __global const int *restrict talus,
    __global const int *restrict rock,
    __global const float *restrict weight,
    __global const float *restrict rock_weight,
    __global long *restrict exported,
    const float axial,
    const float diagonal,
    const int open,
    const int rows,
    const int cols)
{
#define FLUX(j, slanted) \
    thermal_slip( \
        height, talus, rock, weight, rock_weight, i, j, slanted, slanted ? diagonal : axial)
#define INNER(i) \
    thermal_settle(height, result, bed, i, ALL_EIGHT(FLUX, -cols, cols, -east, east))
#define LEAVING(slanted, share) \
    thermal_larger(d, slanted, share, talus[i], rock[i], weight[i], rock_weight[i])
#define EDGE(at, row, col) \
    const int i = at; \
    int out = ALL_EIGHT(FLUX, UP, DOWN, LEFT, RIGHT); \
    for (int side = 0; open && side < 4; ++side) { \
        const int d = thermal_outward(height, side, i, row, col, rows, cols); \
        if (d <= 0) continue; \
        const int leaving = LEAVING(0, axial) + 2 * LEAVING(1, diagonal); \
        exported[side * (rows > cols ? rows : cols) + (side < 2 ? col : row)] += leaving; \
        out += leaving; \
    } \
    thermal_settle(height, result, bed, i, out)
    THERMAL_EACH(INNER, EDGE)
#undef FLUX
#undef INNER
#undef LEAVING
#undef EDGE
}

// Slopes (tangents) as differences to an axial neighbour, quanta.
__kernel void thermal_limit(
    __global const float *restrict repose,
    __global int *restrict limit,
    const float scale,
    const int count)
{
    const int i = (int)get_global_id(0);
    if (i < count) limit[i] = thermal_limit_of(repose[i], scale);
}

// Pass 1 on a mesh.
__kernel void thermal_hold_mesh(
    __global const int *height,
    __global const int *bed,
    __global const float *slope,
    __global float *weight,
    __global const int *start,
    __global const int *neighbor,
    __global const float *length,
    __global const float *conductance,
    __global const float *height_a_volume,
    const int count)
{
    const int i = (int)get_global_id(0);
    if (i >= count) return;
    long out = 0;
    for (int k = start[i]; k < start[i + 1]; ++k) {
        const int limit = thermal_limit_of(slope[i], length[k]);
        const int e = thermal_beyond(height[i] - height[neighbor[k]], limit);
        out += (long)(conductance[k] * (float)e);
    }
    const float given = (float)(out + (start[i + 1] - start[i]) + 1) * height_a_volume[i];
    const float loose = (float)(height[i] - bed[i]);
    weight[i] = loose < given ? loose / given * 0.99999905f : 1.0f;
}

// Pass 2 on a mesh.
__kernel void thermal_slide_mesh(
    __global const int *height,
    __global int *result,
    __global int *bed,
    __global long *volume,
    __global const int *base,
    __global const float *slope,
    __global const float *rock,
    __global const float *weight,
    __global const float *rock_weight,
    __global const int *start,
    __global const int *neighbor,
    __global const float *length,
    __global const float *conductance,
    __global const float *height_a_volume,
    const int count)
{
    const int i = (int)get_global_id(0);
    if (i >= count) return;
    long sum = 0;
    for (int k = start[i]; k < start[i + 1]; ++k) {
        const int j = neighbor[k];
        const int d = height[i] - height[j];
        const int upper = d > 0 ? i : j;
        const int steep = d > 0 ? d : -d;
        const int loose = thermal_beyond(steep, thermal_limit_of(slope[upper], length[k]));
        const int firm = thermal_beyond(steep, thermal_limit_of(rock[upper], length[k]));
        const long given = (long)(conductance[k] * weight[upper] * (float)loose);
        const long broken = (long)(conductance[k] * rock_weight[upper] * (float)firm);
        const long flux = given > broken ? given : broken;
        sum += d > 0 ? flux : -flux;
    }
    const long total = volume[i] - sum;
    volume[i] = total;
    const int after = base[i] + (int)((float)total * height_a_volume[i]);
    result[i] = after;
    bed[i] = bed[i] < after ? bed[i] : after;
}
#endif
