// Shallow water that carries sediment, on integer counts. Twin of reference.py.
//
// Fields have a frame of two cells around the map: the outer world, which pass 2 never changes.
// Cell k has the edge east[k] to k + 1 and the edge south[k] to k + stride; discharge through an
// edge is positive eastwards and southwards. What passes an edge is a whole number of quanta that
// both sides compute alike, so that water and rock add up exactly.
// Fractions are rounded by a threshold that changes from step to step (0.5/32 to 31.5/32, each
// once a block of 32), so that the mean over a block is right however small the flow is.
// HYDRAULIC_FIELDS: rain and softness vary from cell to cell.

#define HYDRAULIC_FULL 536870912   // counts of water or load that a cell can hold, 2^29
#define HYDRAULIC_WALL 1073741824  // height of a closed border, 2^30
#define HYDRAULIC_THIN 1e-5f       // metres of water that do not flow
#define HYDRAULIC_STILL 1e-12f     // m2/s that count as none, so that no number is subnormal
#define HYDRAULIC_STORM_FROM 0.55f // share of a lattice cell's strength that brings no rain
#define HYDRAULIC_STORM_PEAK 20.37f// so that the mean is 1; measured
#define HYDRAULIC_LEAST 1e-6f      // counts that count as none
#define HYDRAULIC_MUD 0.5f         // creep under water, of that under raindrops
#define HYDRAULIC_SPARE 4          // counts that stay behind, for the rounding of four edges

#ifdef HYDRAULIC_FIELDS
#define RAIN(k) ((rain[k] + rain_turn) >> 5)
#define SOFTNESS(k) softness[k]
#else
#define RAIN(k) ((rain_count + rain_turn) >> 5)
#define SOFTNESS(k) soft
#endif

// The library's sqrt is a call on PoCL, which leaves loops scalar; both are correctly rounded.
#ifdef TERRAKIT_CPU
#define ROOT(x) __builtin_sqrtf(x)
#else
#define ROOT(x) sqrt(x)
#endif

#define INLINE __attribute__((always_inline)) inline

INLINE float hydraulic_larger(float a, float b) { return a > b ? a : b; }
INLINE float hydraulic_smaller(float a, float b) { return a < b ? a : b; }
INLINE float hydraulic_size(float a) { return a < 0.0f ? -a : a; }
INLINE int hydraulic_least(int a, int b) { return a < b ? a : b; }

// h^(-1/3), h > 0: a guess within 4 % from the exponent, then three Newton steps.
INLINE float hydraulic_inverse_cube_root(float h)
{
    const float third = h * 0.33333334f;
    float r = as_float(1419967116 - (int)((float)as_int(h) * 0.33333334f));
    r = r * (1.3333334f - third * (r * r * r));
    r = r * (1.3333334f - third * (r * r * r));
    return r * (1.3333334f - third * (r * r * r));
}

// Fall of the water surface from i to j over their distance, -1 to 1.
INLINE float hydraulic_slope(int bi, int bj, int di, int dj, float bed_slope, float water_slope)
{
    const float s = (float)(bi - bj) * bed_slope + (float)(di - dj) * water_slope;
    return s > 1.0f ? 1.0f : (s < -1.0f ? -1.0f : s);
}

// New discharge from i to j: local inertia with Manning friction, implicit in the discharge.
INLINE float hydraulic_inertial(
    int bi, int bj, int di, int dj, int risen, float q,
    float bed_quantum, float water_quantum, float bed_slope, float water_slope,
    float push, float drag, float wave_depth, float calming, float inverse_friction,
    float critical, float empty)
{
    const float hi = (float)di * water_quantum;
    const float hj = (float)dj * water_quantum;
    const float drop = (float)(bi - bj) * bed_quantum;
    const float slope = hydraulic_slope(bi, bj, di, dj, bed_slope, water_slope);
    const float deep = drop > 0.0f ? hydraulic_larger(hi, hj - drop)
                                   : hydraulic_larger(hj, hi + drop);
    const float h = deep < HYDRAULIC_THIN ? HYDRAULIC_THIN : deep;
    const float r = hydraulic_inverse_cube_root(h);
    const float r2 = r * r;
    const float r4 = r2 * r2;
    const float light = hydraulic_smaller(h, wave_depth);
    const float swell = h > light ? calming * ((float)risen * water_slope) : 0.0f;
    const float pushed = q + push * light * (slope + swell);
    const float x = hydraulic_size(pushed);
    float next = 2.0f * x / (1.0f + ROOT(1.0f + drag * light * (r4 * r4 * r2) * x));
    const float h3 = h * h * h;
    const float manning = hydraulic_size(slope) * (h3 * h * r2) * inverse_friction;
    next = hydraulic_smaller(next, ROOT(hydraulic_larger(manning, critical * h3)));
    next = hydraulic_smaller(next, (pushed > 0.0f ? hi : hj) * empty);
    next = deep < HYDRAULIC_THIN || next < HYDRAULIC_STILL ? 0.0f : next;
    return pushed > 0.0f ? next : -next;
}

// Pass 1: discharge through every edge, along the axes and the diagonals.
__kernel void hydraulic_flow(
    __global const int *bed,
    __global const int *depth,
    __global const int *before,
    __global float *east,
    __global float *south,
    __global float *south_east,
    __global float *south_west,
    const float bed_quantum,
    const float water_quantum,
    const float bed_slope,
    const float water_slope,
    const float bed_slant,
    const float water_slant,
    const float push,
    const float drag,
    const float wave_depth,
    const float calming,
    const float inverse_friction,
    const float critical,
    const float empty,
    const float empty_slant,
    const int rows,
    const int cols)
{
    const int stride = cols + 4;
#define FLOW_EDGE(name, q, j, bed_fall, water_fall, most)                                         \
    const float name = hydraulic_inertial(                                                        \
        bed[k], bed[j], depth[k], depth[j], (depth[k] - before[k]) - (depth[j] - before[j]),      \
        q[k], bed_quantum, water_quantum, bed_fall, water_fall, push, drag, wave_depth, calming,  \
        inverse_friction, critical, most);
#define FLOW(k)                                                                                   \
    FLOW_EDGE(to_east, east, k + 1, bed_slope, water_slope, empty)                                \
    FLOW_EDGE(to_south, south, k + stride, bed_slope, water_slope, empty)                         \
    FLOW_EDGE(to_right, south_east, k + stride + 1, bed_slant, water_slant, empty_slant)          \
    FLOW_EDGE(to_left, south_west, k + stride - 1, bed_slant, water_slant, empty_slant)           \
    east[k] = to_east;                                                                            \
    south[k] = to_south;                                                                          \
    south_east[k] = to_right;                                                                     \
    south_west[k] = to_left;
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows + 3) return;
    const int start = row * stride;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int k = start; k < start + stride; ++k) {
        FLOW(k)
    }
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= stride || row >= rows + 3) return;
    const int k = row * stride + col;
    FLOW(k)
#endif
}

// Pass 1 of the virtual pipes (Mei 2007): no depth, no friction.
INLINE float hydraulic_piped(
    int bi, int bj, int di, int dj, float q, float water_quantum, float bed_slope,
    float water_slope, float push, float empty)
{
    const float slope =
        (float)(bi - bj) * bed_slope + (float)(di - dj) * water_slope;
    const float pushed = q + push * slope;
    const float next = hydraulic_size(pushed) < HYDRAULIC_STILL ? 0.0f : pushed;
    const float most = (next > 0.0f ? (float)di : (float)dj) * water_quantum * empty;
    return next > most ? most : (next < -most ? -most : next);
}

__kernel void hydraulic_pipe(
    __global const int *bed,
    __global const int *depth,
    __global float *east,
    __global float *south,
    __global float *south_east,
    __global float *south_west,
    const float water_quantum,
    const float bed_slope,
    const float water_slope,
    const float bed_slant,
    const float water_slant,
    const float push,
    const float empty,
    const float empty_slant,
    const int rows,
    const int cols)
{
    const int stride = cols + 4;
#define PIPE_EDGE(name, q, j, bed_fall, water_fall, most)                                         \
    const float name = hydraulic_piped(                                                           \
        bed[k], bed[j], depth[k], depth[j], q[k], water_quantum, bed_fall, water_fall, push, most);
#define PIPE(k)                                                                                   \
    PIPE_EDGE(to_east, east, k + 1, bed_slope, water_slope, empty)                                \
    PIPE_EDGE(to_south, south, k + stride, bed_slope, water_slope, empty)                         \
    PIPE_EDGE(to_right, south_east, k + stride + 1, bed_slant, water_slant, empty_slant)          \
    PIPE_EDGE(to_left, south_west, k + stride - 1, bed_slant, water_slant, empty_slant)           \
    east[k] = to_east;                                                                            \
    south[k] = to_south;                                                                          \
    south_east[k] = to_right;                                                                     \
    south_west[k] = to_left;
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows + 3) return;
    const int start = row * stride;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int k = start; k < start + stride; ++k) {
        PIPE(k)
    }
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= stride || row >= rows + 3) return;
    const int k = row * stride + col;
    PIPE(k)
#endif
}

// Share of what wants to leave a cell in this step that does: never more than there is.
INLINE float hydraulic_share(
    __global const int *depth, __global const float *east, __global const float *south, int k,
    int one, int other, float rate, float available)
{
    const float e = east[k], w = -east[k - one], s = south[k], n = -south[k - other];
    const float wanted = rate * ((hydraulic_larger(e, 0.0f) + hydraulic_larger(w, 0.0f)) +
                                 (hydraulic_larger(s, 0.0f) + hydraulic_larger(n, 0.0f)));
    const int d = depth[k];
    const int left = d - (d >> 20) - HYDRAULIC_SPARE;
    const float have = (float)(left > 0 ? left : 0) * available;
    return wanted > have ? have / wanted : 1.0f;
}

// Suspended load to a count of water.
INLINE float hydraulic_concentration(
    __global const int *load, __global const int *depth, int k)
{
    const int m = load[k];
    const int moving = m - (m >> 20) - 2 * HYDRAULIC_SPARE;
    const int d = depth[k];
    return (float)(moving > 0 ? moving : 0) / (float)(d > 1 ? d : 1);
}

// Size of the flow through an edge, in counts; what never makes a whole count is none.
INLINE float hydraulic_passing(float q, float rate, float share)
{
    const float size = hydraulic_size(q) * rate * share;
    return size < HYDRAULIC_LEAST ? 0.0f : size;
}

// Counts that pass an edge, from the size of the flow and the room beyond.
INLINE int hydraulic_whole(float size, float threshold, int held_beyond)
{
    const int count = (int)(size + threshold);
    const int room = (HYDRAULIC_FULL - held_beyond) >> 2;
    const int most = room > 0 ? room : 0;
    return count < most ? count : most;
}

// Load that passes an edge: with the water that comes from its side, and by mixing.
INLINE float hydraulic_mixed(
    float flow, float size, float c, float beyond, float spread, int shallow)
{
    return (flow > 0.0f ? size * c : -size * beyond) + spread * (float)shallow * (c - beyond);
}

// Water and load through one edge of a cell, to neighbour j; q > 0 flows out.
#define HYDRAULIC_EDGE(name, q, j, share_there)                                                   \
    const float name##_size = hydraulic_passing(q, rate, (q) > 0.0f ? share : share_there);       \
    const int name##_d = depth[j];                                                                \
    const int name##_w = hydraulic_whole(name##_size, water_turn, (q) > 0.0f ? name##_d : d);     \
    const float name##_c = hydraulic_concentration(load, depth, j);                               \
    const float name##_carried =                                                                  \
        hydraulic_mixed(q, name##_size, c, name##_c, spread, hydraulic_least(d, name##_d));       \
    const int name##_m = hydraulic_whole(                                                         \
        hydraulic_size(name##_carried), load_turn, name##_carried > 0.0f ? load[j] : m);

// Everything that passes the four edges of cell k: the depth d1 and load m1 that result.
#define HYDRAULIC_CARRY(k, one, other, first, second)                                             \
    const int d = depth[k], m = load[k];                                                          \
    const float c = hydraulic_concentration(load, depth, k);                                      \
    const float share = hydraulic_share(depth, first, second, k, one, other, rate, available);    \
    const float share_e = hydraulic_share(depth, first, second, k + (one), one, other, rate, available);\
    const float share_w = hydraulic_share(depth, first, second, k - (one), one, other, rate, available);\
    const float share_s = hydraulic_share(depth, first, second, k + (other), one, other, rate, available);\
    const float share_n = hydraulic_share(depth, first, second, k - (other), one, other, rate, available);\
    const float qe = first[k], qw = -first[k - (one)], qs = second[k], qn = -second[k - (other)]; \
    HYDRAULIC_EDGE(e, qe, k + (one), share_e)                                                     \
    HYDRAULIC_EDGE(w, qw, k - (one), share_w)                                                     \
    HYDRAULIC_EDGE(s, qs, k + (other), share_s)                                                   \
    HYDRAULIC_EDGE(n, qn, k - (other), share_n)                                                   \
    const int out = ((qe > 0.0f ? e_w : -e_w) + (qw > 0.0f ? w_w : -w_w)) +                       \
                    ((qs > 0.0f ? s_w : -s_w) + (qn > 0.0f ? n_w : -n_w));                        \
    const int d1 = d - out + RAIN(k);                                                             \
    const int carried = ((e_carried > 0.0f ? e_m : -e_m) + (w_carried > 0.0f ? w_m : -w_m)) +     \
                        ((s_carried > 0.0f ? s_m : -s_m) + (n_carried > 0.0f ? n_m : -n_m));      \
    const int m1 = m - carried;

// Pass 2: water and load through the edges along the axes.
__kernel void hydraulic_carry(
    __global const int *depth,
    __global int *depth_after,
    __global const int *load,
    __global int *load_after,
    __global const float *east,
    __global const float *south,
    __global const int *rain,
    const int rain_count,
    const int rain_turn,
    const float water_turn,
    const float load_turn,
    const float rate,
    const float available,
    const float spread,
    const int rows,
    const int cols)
{
    const int stride = cols + 4;
#define CARRY(k)                                                                                  \
    HYDRAULIC_CARRY(k, 1, stride, east, south)                                                    \
    depth_after[k] = d1;                                                                          \
    load_after[k] = m1;
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    const int start = (row + 2) * stride + 2;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int k = start; k < start + cols; ++k) {
        CARRY(k)
    }
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    const int k = (row + 2) * stride + col + 2;
    CARRY(k)
#endif
}

// Work of the flow through an edge along an axis, and what a neighbour allows: its bed, and the
// surface of its water (far below where there is a wall).
#define HYDRAULIC_WORK(name, q, j, bed_fall, water_fall)                                          \
    const int name##_b = bed[j];                                                                  \
    const int name##_top =                                                                        \
        name##_b == HYDRAULIC_WALL ? -HYDRAULIC_WALL : name##_b + (depth[j] >> shift);            \
    const float name##_fall = hydraulic_slope(b, name##_b, d, depth[j], bed_fall, water_fall);    \
    const float name##_work = (q) * hydraulic_size(name##_fall);

#define HYDRAULIC_LOW(x, y, z, w)                                                                 \
    hydraulic_least(hydraulic_least(x, y), hydraulic_least(z, w))

INLINE int hydraulic_most(int a, int b) { return a > b ? a : b; }
#define HYDRAULIC_HIGH(x, y, z, w)                                                                \
    hydraulic_most(hydraulic_most(x, y), hydraulic_most(z, w))

// Too little to be squared counts as none.
INLINE float hydraulic_flushed(float x) { return hydraulic_size(x) < 1e-15f ? 0.0f : x; }

// Pass 3: water and load through the diagonal edges, then erosion or deposition.
__kernel void hydraulic_work(
    __global const int *bed,
    __global int *bed_after,
    __global const int *depth,
    __global int *depth_after,
    __global const int *load,
    __global int *load_after,
    __global const float *east,
    __global const float *south,
    __global const float *south_east,
    __global const float *south_west,
    __global int *rock,
    __global const int *rain,
    __global const float *softness,
    const int rain_count,
    const float soft,
    const int rain_turn,
    const float water_turn,
    const float load_turn,
    const float bed_turn,
    const float rate,
    const float available,
    const float spread,
    const float unit,
    const float bed_slope,
    const float water_slope,
    const float bed_slant,
    const float water_slant,
    const float water_quantum,
    const float friction,
    const float capacity,
    const float least_slope,
    const float threshold,
    const float erosion_share,
    const float deposition_share,
    const int thin,
    const int shift,
    const int rows,
    const int cols)
{
    const int stride = cols + 4;
#define WORK(k)                                                                                   \
    HYDRAULIC_CARRY(k, stride + 1, stride - 1, south_east, south_west)                            \
    const int b = bed[k];                                                                         \
    HYDRAULIC_WORK(se, e_size, k + stride + 1, bed_slant, water_slant)                            \
    HYDRAULIC_WORK(nw, w_size, k - stride - 1, bed_slant, water_slant)                            \
    HYDRAULIC_WORK(sw, s_size, k + stride - 1, bed_slant, water_slant)                            \
    HYDRAULIC_WORK(ne, n_size, k - stride + 1, bed_slant, water_slant)                            \
    const float pe = east[k], pw = -east[k - 1], ps = south[k], pn = -south[k - stride];          \
    HYDRAULIC_WORK(ee, hydraulic_size(pe), k + 1, bed_slope, water_slope)                         \
    HYDRAULIC_WORK(ww, hydraulic_size(pw), k - 1, bed_slope, water_slope)                         \
    HYDRAULIC_WORK(ss, hydraulic_size(ps), k + stride, bed_slope, water_slope)                    \
    HYDRAULIC_WORK(nn, hydraulic_size(pn), k - stride, bed_slope, water_slope)                    \
    const float power = 0.25f * (((ee_work + ww_work) + (ss_work + nn_work)) +                    \
                                 ((se_work + nw_work) + (sw_work + ne_work)) * unit);             \
    const float rise_x = 0.5f * (ee_fall - ww_fall), rise_y = 0.5f * (ss_fall - nn_fall);         \
    const float sine = power / ROOT(1.0f + (rise_x * rise_x + rise_y * rise_y));                  \
    const float one_way = (qe > 0.0f ? e_size : -e_size) - (qw > 0.0f ? w_size : -w_size);        \
    const float other_way = (qs > 0.0f ? s_size : -s_size) - (qn > 0.0f ? n_size : -n_size);      \
    const float half_unit = 0.35355339f * unit;                                                   \
    const float along = hydraulic_flushed(                                                        \
        0.25f * (pe - pw) + 0.5f * (half_unit * (one_way - other_way)));                          \
    const float down = hydraulic_flushed(                                                         \
        0.25f * (ps - pn) + 0.5f * (half_unit * (one_way + other_way)));                          \
    const float passing = ROOT(along * along + down * down);                                      \
    const float driven = hydraulic_larger(sine, least_slope * passing);                           \
    const float h = hydraulic_larger((float)d * water_quantum, HYDRAULIC_THIN);                   \
    const float r = hydraulic_inverse_cube_root(h);                                               \
    const float r2 = r * r;                                                                       \
    const float fell = hydraulic_larger(passing * (r2 * r2 * r) * friction, 1e-10f);              \
    const float spare_power = hydraulic_smaller(driven, passing * (fell * fell)) - threshold;     \
    const float held = capacity * hydraulic_larger(spare_power, 0.0f);                            \
    const float able = held < 0.001f ? 0.0f : (held < 268435456.0f ? held : 268435456.0f);        \
    const float short_of = able - (float)m1;                                                      \
    const int low = hydraulic_least(                                                              \
        HYDRAULIC_LOW(ee_b, ww_b, ss_b, nn_b), HYDRAULIC_LOW(se_b, nw_b, sw_b, ne_b));            \
    const int fall = b > low ? (b - low) >> 3 : 0;                                                \
    const int cut = hydraulic_least(                                                              \
        (int)(hydraulic_larger(short_of, 0.0f) * erosion_share + bed_turn), fall);                \
    const int dry = d1 < thin;                                                                    \
    const int loose = b - rock[k];                                                                \
    const int of_loose = hydraulic_least(cut, loose);                                             \
    const int of_rock = hydraulic_least(                                                          \
        (int)((float)(cut - of_loose) * SOFTNESS(k) + bed_turn), fall << 2);                      \
    const int eroded = dry ? 0 : of_loose + of_rock;                                              \
    const int top = hydraulic_most(HYDRAULIC_HIGH(ee_top, ww_top, ss_top, nn_top),                \
                                   HYDRAULIC_HIGH(se_top, nw_top, sw_top, ne_top));               \
    const int gap = top > b ? (top - b) >> 1 : 0;                                                 \
    const int settling = hydraulic_least(                                                         \
        (int)(hydraulic_larger(-short_of, 0.0f) * deposition_share + bed_turn), gap);             \
    const int laid = dry ? m1 : hydraulic_least(settling, m1);                                    \
    const int b1 = b - eroded + laid;                                                             \
    bed_after[k] = b1;                                                                            \
    depth_after[k] = d1;                                                                          \
    load_after[k] = m1 + eroded - laid;                                                           \
    rock[k] = hydraulic_least(rock[k], b1);
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    const int start = (row + 2) * stride + 2;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int k = start; k < start + cols; ++k) {
        WORK(k)
    }
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    const int k = (row + 2) * stride + col + 2;
    WORK(k)
#endif
}

// Counts that slide from i to j: what is beyond the talus, and a share of the whole difference.
INLINE int hydraulic_sliding(int d, int talus, float slump, float creep)
{
    const int down = d - talus, up = -d - talus;
    const int beyond = (down > 0 ? down : 0) + (up > 0 ? up : 0);
    const int count = (int)(slump * (float)beyond + creep * hydraulic_size((float)d));
    return d < 0 ? -count : count;
}

// Once a block: banks slump, rain splashes soil downhill; under water mud creeps at half the rate.
// Eight neighbours, isotropic.
__kernel void hydraulic_slump(
    __global const int *bed,
    __global int *bed_after,
    __global int *rock,
    __global const int *depth,
    const int drowned,
    const int talus,
    const float slump,
    const float creep,
    const int round_the_map,
    const int rows,
    const int cols)
{
    const int stride = cols + 4;
#define SLIDE(k, j, inside, limit, part)                                                          \
    ((inside) ? hydraulic_sliding(bed[k] - bed[j], limit, slump * part,                           \
                                  creep * part * (depth[k] > drowned && depth[j] > drowned        \
                                                      ? HYDRAULIC_MUD : 1.0f))                    \
              : 0)
#define SLUMP(k, col)                                                                             \
    const int slanted = (int)((float)talus * 1.41421356f);                                        \
    const int west = col > 0 || round_the_map;                                                    \
    const int east = col < cols - 1 || round_the_map;                                             \
    const int sum =                                                                               \
        SLIDE(k, k - 1, west, talus, 0.6666667f) + SLIDE(k, k + 1, east, talus, 0.6666667f) +     \
        SLIDE(k, k - stride, north, talus, 0.6666667f) +                                          \
        SLIDE(k, k + stride, south, talus, 0.6666667f) +                                          \
        SLIDE(k, k - stride - 1, north && west, slanted, 0.16666667f) +                           \
        SLIDE(k, k - stride + 1, north && east, slanted, 0.16666667f) +                           \
        SLIDE(k, k + stride - 1, south && west, slanted, 0.16666667f) +                           \
        SLIDE(k, k + stride + 1, south && east, slanted, 0.16666667f);                            \
    const int b1 = bed[k] - sum;                                                                  \
    bed_after[k] = b1;                                                                            \
    rock[k] = hydraulic_least(rock[k], b1);
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    const int start = (row + 2) * stride + 2;
    const int north = row > 0 || round_the_map, south = row < rows - 1 || round_the_map;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int col = 0; col < cols; ++col) {
        SLUMP(start + col, col)
    }
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    const int north = row > 0 || round_the_map, south = row < rows - 1 || round_the_map;
    SLUMP((row + 2) * stride + col + 2, col)
#endif
}

// What leaves the map over its edge, and what comes: one item a cell of the frame's inner ring.
__kernel void hydraulic_border(
    __global const int *bed,
    __global const int *depth,
    __global const int *load,
    __global const float *east,
    __global const float *south,
    __global long *water_left,
    __global long *water_came,
    __global long *load_left,
    const float water_turn,
    const float load_turn,
    const float rate,
    const float available,
    const float spread,
    const int one,
    const int other,
    const int rows,
    const int cols)
{
    const int i = (int)get_global_id(0);
    const int stride = cols + 4;
    const int wide = cols + 2;
    if (i >= 2 * wide + 2 * rows) return;
    const int along = i < 2 * wide ? i % wide : (i - 2 * wide) % rows;
    const int second = i < 2 * wide ? i >= wide : i - 2 * wide >= rows;
    const int row = i < 2 * wide ? (second ? rows + 2 : 1) : along + 2;
    const int col = i < 2 * wide ? along + 1 : (second ? cols + 2 : 1);
    const int k = row * stride + col;
    if (bed[k] == HYDRAULIC_WALL) return;
    const int d = depth[k], m = load[k];
    const float c = hydraulic_concentration(load, depth, k);
    const float share = hydraulic_share(depth, east, south, k, one, other, rate, available);
    long left = 0, came = 0, carried = 0;
    for (int n = 0; n < 4; ++n) {
        const int step = n < 2 ? one : other;
        const int j = n % 2 ? k - step : k + step;
        const int line = j / stride;
        const int jr = line - 2, jc = j - line * stride - 2;
        if (jr < 0 || jr >= rows || jc < 0 || jc >= cols) continue;
        const float flow = n < 2 ? (n % 2 ? -east[j] : east[k]) : (n % 2 ? -south[j] : south[k]);
        const float there = hydraulic_share(depth, east, south, j, one, other, rate, available);
        const float size = hydraulic_passing(flow, rate, flow > 0.0f ? share : there);
        const int w = hydraulic_whole(size, water_turn, flow > 0.0f ? depth[j] : d);
        const float beyond = hydraulic_concentration(load, depth, j);
        const float mixed =
            hydraulic_mixed(flow, size, c, beyond, spread, hydraulic_least(d, depth[j]));
        const int g = hydraulic_whole(
            hydraulic_size(mixed), load_turn, mixed > 0.0f ? load[j] : m);
        if (flow > 0.0f) came += w; else left += w;
        carried += mixed > 0.0f ? -g : g;
    }
    water_left[i] += left;
    water_came[i] += came;
    load_left[i] += carried;
}

// The far side of the map is beyond its edge: fill the frame, one item a cell of it.
__kernel void hydraulic_wrap(
    __global int *bed,
    __global int *depth,
    __global int *load,
    const int rows,
    const int cols)
{
    const int i = (int)get_global_id(0);
    const int stride = cols + 4;
    const int above = 4 * stride;
    if (i >= above + 4 * rows) return;
    const int side = i - above;
    const int line = i / stride;
    const int row = i < above ? (line < 2 ? line : rows + line) : side / 4 + 2;
    const int col = i < above ? i - line * stride : (side % 4 < 2 ? side % 4 : cols + side % 4);
    const int from = ((row - 2 + 2 * rows) % rows + 2) * stride + (col - 2 + 2 * cols) % cols + 2;
    const int k = row * stride + col;
    bed[k] = bed[from];
    depth[k] = depth[from];
    load[k] = load[from];
}

// Once a block: evaporation or infiltration. An item is a column of 32 rows.
__kernel void hydraulic_lose(
    __global int *depth,
    __global const int *loss,
    __global long *total,
    const int varies,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int part = (int)get_global_id(1);
    if (col >= cols || part >= (rows + 31) / 32) return;
    const int last = hydraulic_least(part * 32 + 32, rows);
    long sum = 0;
    for (int row = part * 32; row < last; ++row) {
        const int k = (row + 2) * (cols + 4) + col + 2;
        const int lost = hydraulic_least(loss[varies ? row * cols + col : 0], depth[k]);
        depth[k] -= lost;
        sum += lost;
    }
    total[part * cols + col] += sum;
}

// Once a block: the sea is at its level again. What it gave (or took) is added to the total.
__kernel void hydraulic_level(
    __global const int *bed,
    __global int *depth,
    __global const uchar *sea,
    __global long *total,
    const int level,
    const int shift,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int part = (int)get_global_id(1);
    if (col >= cols || part >= (rows + 31) / 32) return;
    const int last = hydraulic_least(part * 32 + 32, rows);
    long sum = 0;
    for (int row = part * 32; row < last; ++row) {
        const int k = (row + 2) * (cols + 4) + col + 2;
        if (sea[row * cols + col] == 0) continue;
        const int above = level - bed[k];
        const int held = (above > 0 ? above : 0) << shift;
        sum += held - depth[k];
        depth[k] = held;
    }
    total[part * cols + col] += sum;
}

// Once a block: how often a cell is wet, and the mean of what passes it.
__kernel void hydraulic_survey(
    __global const int *depth,
    __global const float *east,
    __global const float *south,
    __global const float *south_east,
    __global const float *south_west,
    __global float *wetness,
    __global float *discharge,
    const int thin,
    const float wetting,
    const float weight,
    const int rows,
    const int cols)
{
    const int stride = cols + 4;
#define SURVEY(k, i)                                                                              \
    const float x = 0.25f * (east[k] + east[k - 1]);                                              \
    const float y = 0.25f * (south[k] + south[k - stride]);                                       \
    const float u = 0.1767767f * (south_east[k] + south_east[k - stride - 1]);                    \
    const float v = 0.1767767f * (south_west[k] + south_west[k - stride + 1]);                    \
    const float across = hydraulic_flushed(x + (u - v));                                          \
    const float down = hydraulic_flushed(y + (u + v));                                            \
    const float passing = ROOT(across * across + down * down);                                    \
    const float wet = depth[k] >= thin ? 1.0f : 0.0f;                                             \
    const float wetter = wetness[i] + (wet - wetness[i]) * wetting;                               \
    wetness[i] = wetter < HYDRAULIC_LEAST ? 0.0f : wetter;                                        \
    discharge[i] = discharge[i] + (passing - discharge[i]) * weight;
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    const int start = (row + 2) * stride + 2;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int col = 0; col < cols; ++col) {
        SURVEY(start + col, row * cols + col)
    }
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    SURVEY((row + 2) * stride + col + 2, row * cols + col)
#endif
}

// Rain of a block where storms pass: cells of rain on a lattice of the world, that come and go.
__kernel void hydraulic_storm(
    __global const int *steady,
    __global int *rain,
    __global const int *east_cell,
    __global const float *east_part,
    __global const int *south_cell,
    __global const float *south_part,
    __global const int *spring,
    __global long *total,
    const int varies,
    const int springs,
    const uint seed_low,
    const uint seed_high,
    const int epoch,
    const float later,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int part = (int)get_global_id(1);
    if (col >= cols || part >= (rows + 31) / 32) return;
    const int last = hydraulic_least(part * 32 + 32, rows);
    const int a = east_cell[col];
    const float u = east_part[col];
    long sum = 0;
    for (int row = part * 32; row < last; ++row) {
        const int b = south_cell[row];
        const float v = south_part[row];
        float at[2];
        for (int t = 0; t < 2; ++t) {
            const uint low = seed_low + 0x9e3779b9u * (uint)(epoch + t);
            const float nw = exact_uniform(exact_hash(low, seed_high, a, b));
            const float ne = exact_uniform(exact_hash(low, seed_high, a + 1, b));
            const float sw = exact_uniform(exact_hash(low, seed_high, a, b + 1));
            const float se = exact_uniform(exact_hash(low, seed_high, a + 1, b + 1));
            const float n = nw + (ne - nw) * u;
            const float s = sw + (se - sw) * u;
            at[t] = n + (s - n) * v;
        }
        const float mixed = at[0] + (at[1] - at[0]) * later;
        const float above = hydraulic_larger(mixed - HYDRAULIC_STORM_FROM, 0.0f);
        const int i = row * cols + col;
        const float mean = (float)steady[varies ? i : 0];
        const float some = mean * (above * HYDRAULIC_STORM_PEAK);
        const int fallen = (int)(some < 268435456.0f ? some : 268435456.0f);
        sum += fallen;
        rain[(row + 2) * (cols + 4) + col + 2] = fallen + (springs ? spring[i] : 0);
    }
    total[part * cols + col] += sum;
}
