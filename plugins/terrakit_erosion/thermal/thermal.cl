// Thermal erosion in integer heights. Twin of reference.py.
//
// Every flux is truncated to whole quanta and is the exact negative of the flux seen from the
// other side, so nothing is lost and the order of additions does not matter.
// THERMAL_TALUS_FIELD: the talus slope varies from cell to cell (talus[] instead of one number).

#ifdef THERMAL_TALUS_FIELD
#define TALUS(i, j, upper_is_i) ((upper_is_i) ? talus[i] : talus[j])
#else
#define TALUS(i, j, upper_is_i) talus[0]
#endif

// Height beyond the talus between two points whose heights differ by d.
inline int thermal_excess(int d, int limit)
{
    const int down = d - limit;
    const int up = -d - limit;
    return (down > 0 ? down : 0) - (up > 0 ? up : 0);
}

// Talus of a diagonal neighbour, sqrt(2) further away.
inline int thermal_diagonal(int axial)
{
    return (int)((float)axial * 1.41421356f);
}

inline int thermal_flux(
    __global const int *height, __global const int *talus, int i, int j, int diagonal, float share)
{
    const int d = height[i] - height[j];
    const int axial = TALUS(i, j, d > 0);
    const int limit = diagonal ? thermal_diagonal(axial) : axial;
    return (int)(share * (float)thermal_excess(d, limit));
}

// Flux through an open border towards the slope that continues from the opposite neighbour;
// material may leave, never enter.
inline int thermal_leaving(
    __global const int *height, __global const int *talus, int i, int opposite, int diagonal,
    float share)
{
    const int d = height[opposite] - height[i];
    const int limit = diagonal ? thermal_diagonal(TALUS(i, i, 1)) : TALUS(i, i, 1);
    const int beyond = d - limit;
    return beyond > 0 ? (int)(share * (float)beyond) : 0;
}

// Sum of the fluxes out of any cell, border cells included.
inline int thermal_outflow(
    __global const int *height, __global const int *talus, __global int *exported,
    int row, int col, int rows, int cols, float axial, float diagonal, int open)
{
    const int i = row * cols + col;
    int sum = 0;
    int leaving = 0;
    for (int dr = -1; dr <= 1; ++dr) {
        for (int dc = -1; dc <= 1; ++dc) {
            if (dr == 0 && dc == 0) continue;
            const int r = row + dr;
            const int c = col + dc;
            const int slanted = dr != 0 && dc != 0;
            const float share = slanted ? diagonal : axial;
            if (r >= 0 && r < rows && c >= 0 && c < cols) {
                sum += thermal_flux(height, talus, i, r * cols + c, slanted, share);
            } else if (open) {
                const int ro = row - dr;
                const int co = col - dc;
                if (ro >= 0 && ro < rows && co >= 0 && co < cols) {
                    leaving += thermal_leaving(height, talus, i, ro * cols + co, slanted, share);
                }
            }
        }
    }
    if (leaving) exported[i] += leaving;
    return sum + leaving;
}

// One sweep of the flux form (Musgrave 1989; sheet S1).
__kernel void thermal_relax(
    __global const int *height,
    __global int *result,
    __global const int *talus,
    __global int *exported,
    const float axial,
    const float diagonal,
    const int open,
    const int rows,
    const int cols)
{
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    const int first = 0;
    const int last = cols - 1;
    const int inside = row > 0 && row < rows - 1;
    if (inside) {
        const int start = row * cols;
        _Pragma("clang loop vectorize(assume_safety)")
        for (int i = start + 1; i < start + last; ++i) {
            int sum = thermal_flux(height, talus, i, i - cols - 1, 1, diagonal);
            sum += thermal_flux(height, talus, i, i - cols, 0, axial);
            sum += thermal_flux(height, talus, i, i - cols + 1, 1, diagonal);
            sum += thermal_flux(height, talus, i, i - 1, 0, axial);
            sum += thermal_flux(height, talus, i, i + 1, 0, axial);
            sum += thermal_flux(height, talus, i, i + cols - 1, 1, diagonal);
            sum += thermal_flux(height, talus, i, i + cols, 0, axial);
            sum += thermal_flux(height, talus, i, i + cols + 1, 1, diagonal);
            result[i] = height[i] - sum;
        }
    }
    for (int col = first; col <= last; col += (inside && last > 0) ? last : 1) {
        const int i = row * cols + col;
        result[i] = height[i] - thermal_outflow(
            height, talus, exported, row, col, rows, cols, axial, diagonal, open);
    }
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    const int i = row * cols + col;
    result[i] = height[i] - thermal_outflow(
        height, talus, exported, row, col, rows, cols, axial, diagonal, open);
#endif
}

// Proportional form, pass 1 (Olsen 2004, Jako & Toth 2011; sheet S2): how much of each excess a
// cell gives away, so that its largest excess shrinks by the share.
__kernel void thermal_weigh(
    __global const int *height,
    __global float *weight,
    __global const int *talus,
    const float share,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    const int i = row * cols + col;
    int largest = 0;
    long sum = 0;
    for (int dr = -1; dr <= 1; ++dr) {
        for (int dc = -1; dc <= 1; ++dc) {
            const int r = row + dr;
            const int c = col + dc;
            if ((dr == 0 && dc == 0) || r < 0 || r >= rows || c < 0 || c >= cols) continue;
            const int limit = (dr != 0 && dc != 0) ? thermal_diagonal(TALUS(i, i, 1))
                                                   : TALUS(i, i, 1);
            const int e = height[i] - height[r * cols + c] - limit;
            if (e > 0) {
                largest = e > largest ? e : largest;
                sum += e;
            }
        }
    }
    weight[i] = sum > 0 ? share * (float)largest / (float)sum : 0.0f;
}

// Proportional form, pass 2: give and take.
__kernel void thermal_share(
    __global const int *height,
    __global int *result,
    __global const float *weight,
    __global const int *talus,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    const int i = row * cols + col;
    int sum = 0;
    for (int dr = -1; dr <= 1; ++dr) {
        for (int dc = -1; dc <= 1; ++dc) {
            const int r = row + dr;
            const int c = col + dc;
            if ((dr == 0 && dc == 0) || r < 0 || r >= rows || c < 0 || c >= cols) continue;
            const int j = r * cols + c;
            const int d = height[i] - height[j];
            const int axial = TALUS(i, j, d > 0);
            const int e = thermal_excess(d, (dr != 0 && dc != 0) ? thermal_diagonal(axial) : axial);
            sum += (int)((e > 0 ? weight[i] : weight[j]) * (float)e);
        }
    }
    result[i] = height[i] - sum;
}

// One sweep on the edge graph of a mesh (sheet M1). Volumes are 64-bit quanta; heights follow
// from them through the area of the vertex.
__kernel void thermal_relax_mesh(
    __global const int *height,
    __global int *result,
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
        const int limit = (int)((d > 0 ? slope[i] : slope[j]) * length[k]);
        sum += (long)(conductance[k] * (float)thermal_excess(d, limit));
    }
    const long total = volume[i] - sum;
    volume[i] = total;
    result[i] = base[i] + (int)((float)total * height_a_volume[i]);
}
