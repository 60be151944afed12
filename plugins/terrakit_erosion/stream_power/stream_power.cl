// Stream power with hillslope diffusion, in integer heights. Twin of reference.py.
//
// POWER_UNIFORM: erodibility is one number. UPLIFT_UNIFORM: uplift is one number.
// CREEP_NONLINEAR: creep grows towards a critical slope.
// SLOPE_LINEAR: the slope exponent is 1, so that each cell is solved without iteration.

#define NEWTON_STEPS 6
#define STEEPEST 0.75f

#ifdef POWER_UNIFORM
#define ERODIBILITY(i) erodibility[0]
#else
#define ERODIBILITY(i) erodibility[i]
#endif
#ifdef UPLIFT_UNIFORM
#define UPLIFT(i) uplift[0]
#else
#define UPLIFT(i) uplift[i]
#endif

// Height that is left of a drop (quanta) to the receiver after a step of time.
//   linear:  y (1 + g) = D          with g = K dt a^m / L
//   else:    s + g s^n = D / L      for the slope s = y / L, by Newton's method
inline int stream_power_left(
    int drop, float strength, float length, float exponent, float quantum)
{
#ifdef SLOPE_LINEAR
    const float g = strength / length;
    return drop - (int)((float)drop * (g / (1.0f + g)));
#else
    const float whole = (float)drop * quantum / length;
    const float g = fmin(strength / length, 1e25f);
    // Each of the two terms alone gives an upper bound, the lower of which is close
    float s = exact_power(whole / fmax(g, 1e-20f), 1.0f / exponent);
    s = fmin(fmax(s, 1e-6f), whole);
    for (int k = 0; k < NEWTON_STEPS; ++k) {
        const float p = g * exact_power(s, exponent);
        const float next = s - (s + p - whole) / (1.0f + exponent * p / s);
        s = fmin(fmax(next, 0.1f * s), whole);
    }
    return drop - (int)((float)drop * ((whole - s) / whole));
#endif
}

// Solve every path from its receiver up: lift, then let the stream cut (Braun & Willett 2013).
__kernel void stream_power_incise(
    __global const int *restrict heads, int start, int count,
    __global const int *restrict receiver,
    __global const int *restrict main_donor,
    __global const int *restrict area,
    __global const uchar *restrict outlet,
    __global const int *restrict before,
    __global int *after,
    __global long *incised,
    __global const float *restrict erodibility,
    __global const int *restrict uplift,
    const float cell_area,
    const float area_exponent,
    const float slope_exponent,
    const float spacing,
    const float quantum,
    const int cols)
{
    const int path = (int)get_global_id(0);
    if (path >= count) return;
    int cell = heads[start + path];
    int below = receiver[cell];
    int base = below == cell ? 0 : after[below];
    while (cell >= 0) {
        int height = before[cell];
        if (!outlet[cell]) {
            height += UPLIFT(cell);
            const int drop = height - base;
            if (below != cell && drop > 1) {
                const int step = cell > below ? cell - below : below - cell;
                const float length = (step == 1 || step == cols) ? spacing : spacing * 1.41421356f;
                const float discharge =
                    fmin(exact_power((float)area[cell] * cell_area, area_exponent), 1e28f);
                const int left = stream_power_left(
                    drop, ERODIBILITY(cell) * discharge, length, slope_exponent, quantum);
                const int lowest = base + (left < 1 ? 1 : left);
                incised[cell] += height - lowest;
                height = lowest;
            }
        }
        after[cell] = height;
        base = height;
        below = cell;
        cell = main_donor[cell];
    }
}

// Flux to a neighbour by creep; with CREEP_NONLINEAR it grows towards the critical slope
// (Roering 1999), capped so that the step stays stable.
inline int stream_power_creep(int d, float share, float slope_of_quantum)
{
#ifdef CREEP_NONLINEAR
    const float s = (float)d * slope_of_quantum;
    const float square = s * s;
    const float grown = share / (1.0f - (square < STEEPEST ? square : STEEPEST));
    return (int)(grown * (float)d);
#else
    return (int)(share * (float)d);
#endif
}

// The sum of what creeps out of any cell; outlets take and never give.
inline int stream_power_creeping(
    __global const int *height, __global const uchar *outlet, int row, int col,
    int rows, int cols, float axial, float diagonal, float axial_slope, float diagonal_slope)
{
    const int i = row * cols + col;
    int sum = 0;
    for (int dr = -1; dr <= 1; ++dr) {
        for (int dc = -1; dc <= 1; ++dc) {
            const int r = row + dr;
            const int c = col + dc;
            if ((dr == 0 && dc == 0) || r < 0 || r >= rows || c < 0 || c >= cols) continue;
            const int j = r * cols + c;
            const int d = height[i] - height[j];
            if (outlet[d > 0 ? i : j]) continue;
            // Along the border, in place of the diagonal that it lacks, as in a mirror
            const int along = (dr == 0 && (row == 0 || row == rows - 1))
                || (dc == 0 && (col == 0 || col == cols - 1));
            sum += (dr != 0 && dc != 0)
                ? stream_power_creep(d, diagonal, diagonal_slope)
                : stream_power_creep(d, axial + (along ? diagonal : 0.0f), axial_slope);
        }
    }
    return sum;
}

#define AXIAL(j) stream_power_creep(height[i] - height[j], axial, axial_slope)
#define DIAGONAL(j) stream_power_creep(height[i] - height[j], diagonal, diagonal_slope)

// One sweep of hillslope diffusion with isotropic weights, as if there were no outlets inside the
// map: stream_power_mend follows it.
__kernel void stream_power_diffuse(
    __global const int *restrict height,
    __global int *restrict result,
    __global const uchar *restrict outlet,
    __global long *restrict received,
    const float axial,
    const float diagonal,
    const float axial_slope,
    const float diagonal_slope,
    const int rows,
    const int cols)
{
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    const int inside = row > 0 && row < rows - 1;
    if (inside) {
        _Pragma("clang loop vectorize(assume_safety)")
        for (int i = row * cols + 1; i < row * cols + cols - 1; ++i) {
            int sum = DIAGONAL(i - cols - 1) + AXIAL(i - cols) + DIAGONAL(i - cols + 1);
            sum += AXIAL(i - 1) + AXIAL(i + 1);
            sum += DIAGONAL(i + cols - 1) + AXIAL(i + cols) + DIAGONAL(i + cols + 1);
            result[i] = height[i] - sum;
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
        const int sum = stream_power_creeping(
            height, outlet, row, col, rows, cols, axial, diagonal, axial_slope,
            diagonal_slope);
        result[i] = outlet[i] ? height[i] : height[i] - sum;
        const int border = row == 0 || row == rows - 1 || col == 0 || col == cols - 1;
        if (border && outlet[i] && sum) received[i] -= sum;
    }
}

// The same for the cells in a list: outlets inside the map (the sea) and their neighbours.
__kernel void stream_power_mend(
    __global const int *restrict height,
    __global int *restrict result,
    __global const uchar *restrict outlet,
    __global long *restrict received,
    const float axial,
    const float diagonal,
    const float axial_slope,
    const float diagonal_slope,
    const int rows,
    const int cols,
    __global const int *restrict list,
    const int count)
{
    const int k = (int)get_global_id(0);
    if (k >= count) return;
    const int i = list[k];
    const int row = i / cols;
    const int sum = stream_power_creeping(
        height, outlet, row, i - row * cols, rows, cols, axial, diagonal, axial_slope,
        diagonal_slope);
    result[i] = outlet[i] ? height[i] : height[i] - sum;
    if (outlet[i] && sum) received[i] -= sum;
}
