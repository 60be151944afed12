// Cellular automaton of rain and dissolved ground, in integer heights. Twin of reference.py.
//
// Every transfer is truncated to whole quanta and is the exact negative of what the other side
// sees, so ground and load together are conserved to the last quantum.
// AUTOMATON_FIELDS: rain and softness vary from cell to cell.

#ifdef AUTOMATON_FIELDS
#define VARYING(field, i) field[i]
#else
#define VARYING(field, i) field[0]
#endif

// Difference of two levels as it counts, so that eight of them fit an int.
__attribute__((always_inline)) inline int automaton_drop(int above, int below)
{
    const int d = above - below;
    return d > 134217728 ? 134217728 : (d < -134217728 ? -134217728 : d);
}

__attribute__((always_inline)) inline int automaton_below(int above, int below)
{
    const int d = automaton_drop(above, below);
    return d > 0 ? d : 0;
}

// Whether a cell has a neighbour in this direction; beyond an open border the slope goes on, so
// that the drop there is the drop from the opposite neighbour, *drop.
__attribute__((always_inline)) inline int automaton_beyond(
    __global const int *level, int row, int col, int dr, int dc, int rows, int cols, int *drop)
{
    const int r = row + dr;
    const int c = col + dc;
    if (r >= 0 && r < rows && c >= 0 && c < cols) return 0;
    const int ro = row - dr;
    const int co = col - dc;
    const int is_known = ro >= 0 && ro < rows && co >= 0 && co < cols;
    *drop = is_known ? automaton_below(level[ro * cols + co], level[row * cols + col]) : 0;
    return 1;
}

// Rain falls and dissolves loose ground first, then bedrock as far as it is soft.
__kernel void automaton_wet(
    __global int *bedrock,
    __global int *loose,
    __global int *water,
    __global int *load,
    __global int *level,
    __global const int *rain,
    __global const float *softness,
    const float solubility,
    const int cells)
{
    const int i = (int)get_global_id(0);
    if (i >= cells) return;
    const int w = water[i] + VARYING(rain, i);
    const int wanted = (int)(solubility * (float)w);
    const int r = loose[i];
    const int of_loose = wanted < r ? wanted : r;
    const int of_bed = (int)(VARYING(softness, i) * (float)(wanted - of_loose));
    const int b = bedrock[i] - of_bed;
    bedrock[i] = b;
    loose[i] = r - of_loose;
    water[i] = w;
    load[i] += of_loose + of_bed;
    level[i] = b + r - of_loose + w;
}

// What a cell gives for each quantum of drop: water, and load with it. A little less than all, so
// that rounding never gives away more than there is.
__attribute__((always_inline)) inline void automaton_give(
    int sum, int lower, int water, int load, __global float *gives, __global float *carries)
{
    const float w = (float)water;
    const float surplus = (float)sum / (float)(lower + 1);
    const float moved = (w < surplus ? w : surplus) * 0.99999905f;
    const float share = sum > 0 ? moved / (float)(sum > 0 ? sum : 1) : 0.0f;
    *gives = share;
    *carries = water > 0 ? share * ((float)load / (water > 0 ? w : 1.0f)) : 0.0f;
}

__kernel void automaton_share(
    __global const int *level,
    __global const int *water,
    __global const int *load,
    __global float *gives,
    __global float *carries,
    const int open,
    const int rows,
    const int cols)
{
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    const int inside = row > 0 && row < rows - 1 && cols > 2;
    if (inside) {
        const int start = row * cols;
        _Pragma("clang loop vectorize(assume_safety)")
        for (int i = start + 1; i < start + cols - 1; ++i) {
            const int a = level[i];
            const int d0 = automaton_below(a, level[i - cols - 1]);
            const int d1 = automaton_below(a, level[i - cols]);
            const int d2 = automaton_below(a, level[i - cols + 1]);
            const int d3 = automaton_below(a, level[i - 1]);
            const int d4 = automaton_below(a, level[i + 1]);
            const int d5 = automaton_below(a, level[i + cols - 1]);
            const int d6 = automaton_below(a, level[i + cols]);
            const int d7 = automaton_below(a, level[i + cols + 1]);
            const int lower = (d0 > 0) + (d1 > 0) + (d2 > 0) + (d3 > 0)
                            + (d4 > 0) + (d5 > 0) + (d6 > 0) + (d7 > 0);
            automaton_give(d0 + d1 + d2 + d3 + d4 + d5 + d6 + d7, lower, water[i], load[i],
                           gives + i, carries + i);
        }
    }
    for (int col = 0; col < cols; col += inside ? cols - 1 : 1) {
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    {
#endif
        const int i = row * cols + col;
        int sum = 0;
        int lower = 0;
        for (int dr = -1; dr <= 1; ++dr) {
            for (int dc = -1; dc <= 1; ++dc) {
                if (dr == 0 && dc == 0) continue;
                int d = 0;
                if (automaton_beyond(level, row, col, dr, dc, rows, cols, &d)) {
                    d = open ? d : 0;
                } else {
                    d = automaton_below(level[i], level[i + dr * cols + dc]);
                }
                sum += d;
                lower += d > 0;
            }
        }
        automaton_give(sum, lower, water[i], load[i], gives + i, carries + i);
    }
}

// Water evaporates, and load beyond what is left of it can hold is laid down.
__attribute__((always_inline)) inline void automaton_settle(
    __global int *loose, __global int *water, __global int *load, int i, int w, int m,
    float evaporated, float saturation)
{
    const int left = w - (int)(evaporated * (float)w);
    const float most = saturation * (float)left;
    const int holds = most < 2147483520.0f ? (int)most : 2147483520;
    const int dropped = m > holds ? m - holds : 0;
    water[i] = left;
    load[i] = m - dropped;
    loose[i] += dropped;
}

__attribute__((always_inline)) inline int automaton_flux(
    __global const int *level, __global const float *gives, int i, int j)
{
    const int d = automaton_drop(level[i], level[j]);
    return (int)((d > 0 ? gives[i] : gives[j]) * (float)d);
}

// exported: load that left through each sample of the northern, southern, western and eastern
// border.
__kernel void automaton_gather(
    __global const int *level,
    __global const float *gives,
    __global const float *carries,
    __global int *loose,
    __global int *water,
    __global int *load,
    __global long *exported,
    const float evaporated,
    const float saturation,
    const int open,
    const int rows,
    const int cols)
{
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    const int inside = row > 0 && row < rows - 1 && cols > 2;
    if (inside) {
        const int start = row * cols;
        _Pragma("clang loop vectorize(assume_safety)")
        for (int i = start + 1; i < start + cols - 1; ++i) {
            int w = water[i];
            int m = load[i];
            w -= automaton_flux(level, gives, i, i - cols - 1);
            w -= automaton_flux(level, gives, i, i - cols);
            w -= automaton_flux(level, gives, i, i - cols + 1);
            w -= automaton_flux(level, gives, i, i - 1);
            w -= automaton_flux(level, gives, i, i + 1);
            w -= automaton_flux(level, gives, i, i + cols - 1);
            w -= automaton_flux(level, gives, i, i + cols);
            w -= automaton_flux(level, gives, i, i + cols + 1);
            m -= automaton_flux(level, carries, i, i - cols - 1);
            m -= automaton_flux(level, carries, i, i - cols);
            m -= automaton_flux(level, carries, i, i - cols + 1);
            m -= automaton_flux(level, carries, i, i - 1);
            m -= automaton_flux(level, carries, i, i + 1);
            m -= automaton_flux(level, carries, i, i + cols - 1);
            m -= automaton_flux(level, carries, i, i + cols);
            m -= automaton_flux(level, carries, i, i + cols + 1);
            automaton_settle(loose, water, load, i, w, m, evaporated, saturation);
        }
    }
    for (int col = 0; col < cols; col += inside ? cols - 1 : 1) {
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    {
#endif
        const int i = row * cols + col;
        int w = water[i];
        int m = load[i];
        int gone = 0;
        for (int dr = -1; dr <= 1; ++dr) {
            for (int dc = -1; dc <= 1; ++dc) {
                if (dr == 0 && dc == 0) continue;
                int d = 0;
                if (automaton_beyond(level, row, col, dr, dc, rows, cols, &d)) {
                    w -= open ? (int)(gives[i] * (float)d) : 0;
                    gone += open ? (int)(carries[i] * (float)d) : 0;
                } else {
                    w -= automaton_flux(level, gives, i, i + dr * cols + dc);
                    m -= automaton_flux(level, carries, i, i + dr * cols + dc);
                }
            }
        }
        if (gone) {
            const int slot = row == 0 ? col : row == rows - 1 ? cols + col
                           : col == 0 ? 2 * cols + row : 2 * cols + rows + row;
            exported[slot] += gone;
        }
        automaton_settle(loose, water, load, i, w, m - gone, evaporated, saturation);
    }
}
