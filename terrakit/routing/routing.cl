// Receivers, depressions, drainage area and sweeps over the tree. Cells are numbered row by row;
// a work-item takes `run` consecutive cells (of one row, where rows matter), 1 on a GPU.
// What scatters is an integer atomic, so no result depends on the order of the work-items.

#ifndef RHO8
#define RHO8 0
#endif

#define SQRT2 1.41421356f
#define INVERSE_SQRT2 0.70710678f
#define NOTHING 0xffffffffu
#define KEPT 64

// Take the columns from `first` to `last`, those that have all eight neighbours without any check.
#define FOR_COLUMNS(TAKE)                                        \
    {                                                            \
        const bool inner_row = row > 0 && row < rows - 1;        \
        const int begin = inner_row ? max(first, 1) : last;      \
        const int end = inner_row ? min(last, cols - 1) : last;  \
        for (int col = first; col < min(begin, last); ++col)     \
            TAKE(ANYWHERE)                                       \
        for (int col = begin; col < end; ++col)                  \
            TAKE(INSIDE)                                         \
        for (int col = max(end, begin); col < last; ++col)       \
            TAKE(ANYWHERE)                                       \
    }

// Take a neighbour as receiver if it is strictly steeper than the best so far.
#define LOOK(OTHER, FACTOR)                                     \
    {                                                           \
        const int other = (OTHER);                              \
        const float slope = (float)(z - height[other]) FACTOR;  \
        const bool better = slope > steepest;                   \
        best = better ? other : best;                           \
        steepest = better ? slope : steepest;                   \
    }

// The axes come first. A step beyond the border is 0, so that it meets the cell itself or one of
// its other neighbours again, neither of which is steeper than before.
inline int steepest_neighbour(__global const int *height, int cell, int north, int south,
                              int west, int east, float diagonal)
{
    const int z = height[cell];
    int best = cell;
    float steepest = 0.0f;
    LOOK(cell + north, );
    LOOK(cell + east, );
    LOOK(cell + south, );
    LOOK(cell + west, );
    LOOK(cell + north + east, *diagonal);
    LOOK(cell + south + east, *diagonal);
    LOOK(cell + south + west, *diagonal);
    LOOK(cell + north + west, *diagonal);
    return best;
}

inline float diagonal_factor(uint seed_low, uint seed_high, int row, int col)
{
#if RHO8
    return 1.0f / (2.0f - exact_uniform(exact_hash(seed_low, seed_high, row, col)));
#else
    return INVERSE_SQRT2;
#endif
}

// Find the steepest strictly lower neighbour; outlets, pits and flats keep themselves.
__kernel void routing_receivers(__global const int *restrict height,
                                __global const uchar *restrict outlet,
                                __global int *restrict receiver, uint seed_low, uint seed_high,
                                uint origin_row, uint origin_col, int rows, int cols, int run)
{
    const int row = (int)get_global_id(1);
    const int first = (int)get_global_id(0) * run;
    const int last = min(first + run, cols);
    if (row >= rows || first >= cols)
        return;
    const int north = row > 0 ? -cols : 0;
    const int south = row < rows - 1 ? cols : 0;
    const int start = row * cols;
    const int world_row = (int)(origin_row + (uint)row);
    int col = first;
#define RECEIVER(WEST, EAST)                                                               \
    {                                                                                      \
        const int cell = start + col;                                                      \
        const float factor = diagonal_factor(seed_low, seed_high, world_row, (int)(origin_col + (uint)col)); \
        const int best = steepest_neighbour(height, cell, north, south, WEST, EAST, factor); \
        receiver[cell] = outlet[cell] ? cell : best;                                       \
    }
    if (col == 0) {
        RECEIVER(0, cols > 1 ? 1 : 0);
        ++col;
    }
    for (; col < min(last, cols - 1); ++col)
        RECEIVER(-1, 1);
    if (col < last)
        RECEIVER(-1, 0);
}

// --- depressions ------------------------------------------------------------------------------
// A link is the number of the next cell, or ~(number of the basin) at the end of the chain.
// Basin and component 0 is the outside: all that reaches an outlet.

// Number the pits from 1, in any order, and end their chains.
__kernel void routing_number_pits(__global const int *restrict receiver,
                                  __global const uchar *restrict outlet, __global int *restrict link,
                                  __global int *count, int cells, int run)
{
    const int first = (int)get_global_id(0) * run;
    const int last = min(first + run, cells);
    int pits = 0;
    for (int cell = first; cell < last; ++cell)
        pits += receiver[cell] == cell && !outlet[cell] ? 1 : 0;
    int number = pits > 0 ? atomic_add(count, pits) : 0;
    for (int cell = first; cell < last; ++cell) {
        const int next = receiver[cell];
        int to = next;
        if (next == cell)
            to = outlet[cell] ? ~0 : ~(++number);
        link[cell] = to;
    }
}

// Follow each chain for some links more; the flag rises if some are still not at their end.
__kernel void routing_follow(__global const int *restrict link, __global int *restrict further,
                             __global int *unfinished, int size, int run)
{
    const int first = (int)get_global_id(0) * run;
    const int last = min(first + run, size);
    int going = 0;
    for (int i = first; i < last; ++i) {
        int to = link[i];
        for (int step = 0; step < 15 && to >= 0; ++step)
            to = link[to];
        further[i] = to;
        going |= to >= 0 ? 1 : 0;
    }
    if (going)
        atomic_or(unfinished, 1);
}

// An edge is its smaller cell * 4 + the direction of the other: east, south-west, south, south-east.
inline int far_cell(uint edge, int cols)
{
    const int direction = (int)(edge & 3u);
    return (int)(edge >> 2) + (direction == 0 ? 1 : cols - 2 + direction);
}

// The strict order of passes at one height: a bijective hash, so that ties are never aligned.
inline uint edge_tie(uint edge, uint tie_seed)
{
    return exact_mix(edge ^ tie_seed);
}

// Map integers to unsigned ones in the same order, for atomic_min.
inline uint ordered(int value)
{
    return (uint)value ^ 0x80000000u;
}

// Append the kept edges to the list, whose order is of no consequence.
#define FLUSH()                                                       \
    if (kept > 0) {                                                   \
        const uint at = (uint)atomic_add(count, kept);                \
        for (int k = 0; k < kept; ++k)                                \
            if (at + (uint)k < capacity) {                            \
                edge[at + k] = edges[k];                              \
                one[at + k] = ones[k];                                \
                two[at + k] = twos[k];                                \
            }                                                         \
        kept = 0;                                                     \
    }

// The neighbours of a cell are bits, row by row, with bit 4 the cell itself: for each of them, which
// others touch it.
__constant ushort TOUCHING[9] = {0x00a, 0x02d, 0x022, 0x0c3, 0x000, 0x186, 0x088, 0x168, 0x0a0};

// List the passes: from each cell to the lower cells around it that belong to other basins. Left out
// is what a better pass between the same two basins makes needless: another foreign cell that is
// lower, or another cell of our own that is lower and touches the same foreign cell.
inline int passes_from(__global const int *height, __global const int *link,
                       uint *edges, int *ones, int *twos, uint tie_seed, int rows, int cols,
                       int row, int col)
{
    const int cell = row * cols + col;
    const int z = height[cell];
    const int own = link[cell];
    uint lower_own = 0, lower_foreign = 0;
    for (int down = -1, k = 0; down <= 1; ++down)
        for (int right = -1; right <= 1; ++right, ++k) {
            if (row + down < 0 || row + down >= rows || col + right < 0 || col + right >= cols)
                continue;
            const int other = cell + down * cols + right;
            const bool lower = height[other] < z;
            if (link[other] == own)
                lower_own |= lower ? 1u << k : 0u;
            else if (lower || (height[other] == z && other < cell))
                lower_foreign |= 1u << k;
        }
    int found = 0;
    for (int k = 0; k < 9; ++k) {
        if (!(lower_foreign >> k & 1u) || (lower_own & TOUCHING[k]))
            continue;
        const int down = k < 3 ? -1 : (k < 6 ? 0 : 1);
        const int right = k - 4 - 3 * down;
        const int other = cell + down * cols + right;
        const int foreign = link[other];
        const int low = height[other];
        const int direction = down == 0 ? 0 : 2 + down * right;
        const uint edge = (uint)min(cell, other) * 4u + (uint)direction;
        int slot = 0;
        while (slot < found && ones[slot] != ~foreign && twos[slot] != ~foreign)
            ++slot;
        if (slot < found) {
            const int far = far_cell(edges[slot], cols);
            const int rival = height[far == cell ? (int)(edges[slot] >> 2) : far];
            if (rival < low
                || (rival == low && edge_tie(edges[slot], tie_seed) < edge_tie(edge, tie_seed)))
                continue;
        }
        edges[slot] = edge;
        ones[slot] = other > cell ? ~own : ~foreign;
        twos[slot] = other > cell ? ~foreign : ~own;
        found += slot == found ? 1 : 0;
    }
    return found;
}

__kernel void routing_list_passes(__global const int *restrict height,
                                  __global const int *restrict link, __global uint *restrict edge,
                                  __global int *restrict one, __global int *restrict two,
                                  __global int *count, uint capacity, uint tie_seed, int rows,
                                  int cols, int run)
{
    const int row = (int)get_global_id(1);
    const int first = (int)get_global_id(0) * run;
    const int last = min(first + run, cols);
    if (row >= rows)
        return;
    const bool inner_row = row > 0 && row < rows - 1;
    uint edges[KEPT];
    int ones[KEPT], twos[KEPT];
    int kept = 0;
    for (int col = first; col < last; ++col) {
        // Most cells lie inside a basin: have done with them fast
        if (inner_row && col > 0 && col < cols - 1) {
            __global const int *north = link + (row - 1) * cols + col;
            __global const int *here = north + cols;
            __global const int *south = here + cols;
            const int own = *here;
            if (((north[-1] ^ own) | (north[0] ^ own) | (north[1] ^ own) | (here[-1] ^ own)
                 | (here[1] ^ own) | (south[-1] ^ own) | (south[0] ^ own) | (south[1] ^ own)) == 0)
                continue;
        }
        if (kept > KEPT - 8)
            FLUSH();
        kept += passes_from(height, link, edges + kept, ones + kept, twos + kept, tie_seed, rows,
                            cols, row, col);
    }
    FLUSH();
}

// Boruvka, in three steps of 32 bits: each component but the outside finds its lowest pass by the
// higher cell, then by the lower cell, then by the hash.
__kernel void routing_offer(__global const int *restrict height, __global const uint *restrict edge,
                            __global const int *restrict one, __global const int *restrict two,
                            __global uint *high, __global uint *low, __global uint *tie, int step,
                            uint tie_seed, int cols, int size, int run)
{
    const int first = (int)get_global_id(0) * run;
    const int last = min(first + run, size);
    for (int i = first; i < last; ++i) {
        const uint id = edge[i];
        const int a = one[i];
        const int b = two[i];
        const int z_near = height[id >> 2];
        const int z_far = height[far_cell(id, cols)];
        const uint z_high = ordered(max(z_near, z_far));
        if (step == 0) {
            if (a)
                atomic_min(high + a, z_high);
            if (b)
                atomic_min(high + b, z_high);
            continue;
        }
        const uint z_low = ordered(min(z_near, z_far));
        const bool high_a = a && high[a] == z_high;
        const bool high_b = b && high[b] == z_high;
        if (step == 1) {
            if (high_a)
                atomic_min(low + a, z_low);
            if (high_b)
                atomic_min(low + b, z_low);
            continue;
        }
        if (high_a && low[a] == z_low)
            atomic_min(tie + a, edge_tie(id, tie_seed));
        if (high_b && low[b] == z_low)
            atomic_min(tie + b, edge_tie(id, tie_seed));
    }
}

// Turn the tree of a component round, so that it drains through the given basin and edge.
inline void reroot(__global int *parent, __global uint *spill, int basin, int to, uint edge)
{
    while (basin > 0) {
        const int old_parent = parent[basin];
        const uint old_spill = spill[basin];
        parent[basin] = to;
        spill[basin] = edge;
        to = basin;
        edge = old_spill;
        basin = old_parent;
    }
}

// Join each component to the one beyond its best pass. Of two that chose each other, the smaller
// number stays, and takes its number in the next round from the counter.
__kernel void routing_join(__global const int *restrict basin_link,
                           __global const uint *restrict edge, __global const int *restrict one,
                           __global const int *restrict two, __global const uint *restrict tie,
                           __global int *parent, __global uint *spill, __global int *joined,
                           __global int *count, uint tie_seed, int cols, int size, int run)
{
    const int first = (int)get_global_id(0) * run;
    const int last = min(first + run, size);
    for (int i = first; i < last; ++i) {
        const uint id = edge[i];
        const int a = one[i];
        const int b = two[i];
        const uint own_tie = edge_tie(id, tie_seed);
        const bool wins_a = a && tie[a] == own_tie;
        const bool wins_b = b && tie[b] == own_tie;
        if (!wins_a && !wins_b)
            continue;
        const int near = ~basin_link[id >> 2];
        const int far = ~basin_link[far_cell(id, cols)];
        if (wins_a) {
            if (wins_b && a < b)
                joined[a] = ~(atomic_inc(count) + 1);
            else {
                joined[a] = b;
                reroot(parent, spill, near, far, id);
            }
        }
        if (wins_b) {
            if (wins_a && b < a)
                joined[b] = ~(atomic_inc(count) + 1);
            else {
                joined[b] = a;
                reroot(parent, spill, far, near, id);
            }
        }
    }
}

// Keep the edges that still lead from one component to another, under the new numbers.
__kernel void routing_contract(__global const int *restrict joined,
                               __global const uint *restrict old_edge,
                               __global const int *restrict old_one,
                               __global const int *restrict old_two, __global uint *restrict edge,
                               __global int *restrict one, __global int *restrict two,
                               __global int *count, uint capacity, int size, int run)
{
    const int first = (int)get_global_id(0) * run;
    const int last = min(first + run, size);
    uint edges[KEPT];
    int ones[KEPT], twos[KEPT];
    int kept = 0;
    for (int i = first; i < last; ++i) {
        const int a = ~joined[old_one[i]];
        const int b = ~joined[old_two[i]];
        if (a == b)
            continue;
        if (kept == KEPT)
            FLUSH();
        edges[kept] = old_edge[i];
        ones[kept] = a;
        twos[kept] = b;
        ++kept;
    }
    FLUSH();
}

// Turn the chain of receivers from the pass down to the pit round: a river cuts its way out.
__kernel void routing_carve(__global const int *restrict link, __global const uint *restrict spill,
                            __global int *receiver, int basins, int cols)
{
    const int basin = (int)get_global_id(0) + 1;
    if (basin > basins)
        return;
    const uint edge = spill[basin];
    const int near = (int)(edge >> 2);
    const int far = far_cell(edge, cols);
    const bool leaves_near = link[near] == ~basin;
    int cell = leaves_near ? near : far;
    int previous = leaves_near ? far : near;
    for (;;) {
        const int next = receiver[cell];
        receiver[cell] = previous;
        if (next == cell)
            break;
        previous = cell;
        cell = next;
    }
}

// --- drainage area ----------------------------------------------------------------------------

#define AREA_BITS 29
#define AREA_MASK 0x1fffffffu
#define ONE_DONOR 0x20000000u

// Do something for each donor of a cell, in the order of their numbers; CHECK(down, right) says
// whether there is a cell.
#define ANYWHERE(DOWN, RIGHT) \
    (row + DOWN >= 0 && row + DOWN < rows && col + RIGHT >= 0 && col + RIGHT < cols)
#define INSIDE(DOWN, RIGHT) 1
#define DONOR(CHECK, DOWN, RIGHT, BODY)                                       \
    if (CHECK(DOWN, RIGHT)) {                                                 \
        const int donor = cell + DOWN * cols + RIGHT;                         \
        const bool drains = receiver[donor] == cell;                          \
        BODY                                                                  \
    }
#define DONORS(CHECK, BODY)         \
    DONOR(CHECK, -1, -1, BODY)      \
    DONOR(CHECK, -1, 0, BODY)       \
    DONOR(CHECK, -1, 1, BODY)       \
    DONOR(CHECK, 0, -1, BODY)       \
    DONOR(CHECK, 0, 1, BODY)        \
    DONOR(CHECK, 1, -1, BODY)       \
    DONOR(CHECK, 1, 0, BODY)        \
    DONOR(CHECK, 1, 1, BODY)

// Count the donors; keep the count above the area, which starts with the cell itself.
__kernel void routing_count_donors(__global const int *restrict receiver,
                                   __global uchar *restrict donors, __global uint *restrict area,
                                   int rows, int cols, int run)
{
    const int row = (int)get_global_id(1);
    const int first = (int)get_global_id(0) * run;
    const int last = min(first + run, cols);
    if (row >= rows)
        return;
#define COUNT(CHECK)                                  \
    {                                                 \
        const int cell = row * cols + col;            \
        uint count = 0;                               \
        DONORS(CHECK, count += drains ? 1u : 0u;)     \
        donors[cell] = (uchar)count;                  \
        area[cell] = (count << AREA_BITS) + 1u;       \
    }
    FOR_COLUMNS(COUNT)
}

// Walk downstream from each source. Adding the area and taking a donor off is one atomic, and only
// the last donor to arrive goes on; an outlet may have eight donors, but nobody goes on from there.
__kernel void routing_accumulate(__global const int *restrict receiver,
                                 __global const uchar *restrict donors, __global uint *area,
                                 int cells, int run)
{
    const int first = (int)get_global_id(0) * run;
    const int last = min(first + run, cells);
    for (int source = first; source < last; ++source) {
        if (donors[source])
            continue;
        int cell = source;
        uint total = 1;
        for (;;) {
            const int to = receiver[cell];
            if (to == cell)
                break;
            const uint before = atomic_add(area + to, total - ONE_DONOR);
            if (before >> AREA_BITS != 1u)
                break;
            total += before & AREA_MASK;
            cell = to;
        }
    }
}

// --- paths ------------------------------------------------------------------------------------

// Find the donor with the largest area, the first of equals; -1 without one.
__kernel void routing_main_donors(__global const int *restrict receiver,
                                  __global const int *restrict area,
                                  __global int *restrict main_donor, int rows, int cols, int run)
{
    const int row = (int)get_global_id(1);
    const int first = (int)get_global_id(0) * run;
    const int last = min(first + run, cols);
    if (row >= rows)
        return;
#define CHOOSE(CHECK)                                         \
    {                                                         \
        const int cell = row * cols + col;                    \
        int best = -1, largest = 0;                           \
        DONORS(CHECK, const int size = drains ? area[donor] : 0; \
               best = size > largest ? donor : best;          \
               largest = size > largest ? size : largest;)    \
        main_donor[cell] = best;                              \
    }
    FOR_COLUMNS(CHOOSE)
}

inline bool is_head(__global const int *receiver, __global const int *main_donor, int cell)
{
    const int to = receiver[cell];
    return to == cell || main_donor[to] != cell;
}

// The level of a path: the number of leading zeros of the area at its head.
#define LEVELS 32

// Count the heads of each level in each block of cells.
__kernel void routing_count_heads(__global const int *restrict receiver,
                                  __global const int *restrict main_donor,
                                  __global const int *restrict area, __global int *restrict counts,
                                  int cells, int blocks, int block)
{
    const int own = (int)get_global_id(0);
    if (own >= blocks)
        return;
    const int first = own * block;
    const int last = min(first + block, cells);
    int count[LEVELS];
    for (int level = 0; level < LEVELS; ++level)
        count[level] = 0;
    for (int cell = first; cell < last; ++cell)
        if (is_head(receiver, main_donor, cell))
            ++count[clz(area[cell])];
    for (int level = 0; level < LEVELS; ++level)
        counts[level * blocks + own] = count[level];
}

// List the heads by level and cell; `offsets` says where those of each level and block go.
__kernel void routing_list_heads(__global const int *restrict receiver,
                                 __global const int *restrict main_donor,
                                 __global const int *restrict area,
                                 __global const int *restrict offsets, __global int *restrict heads,
                                 int cells, int blocks, int block)
{
    const int own = (int)get_global_id(0);
    if (own >= blocks)
        return;
    const int first = own * block;
    const int last = min(first + block, cells);
    int at[LEVELS];
    for (int level = 0; level < LEVELS; ++level)
        at[level] = offsets[level * blocks + own];
    for (int cell = first; cell < last; ++cell)
        if (is_head(receiver, main_donor, cell))
            heads[at[clz(area[cell])]++] = cell;
}

// --- sweeps from the outlets up ---------------------------------------------------------------
// Each work-item walks up one path of a level, from its head along the main donors. What it needs
// of the receiver of the head was written by an earlier level.

// The level at which water finds a way out: the highest cell between here and the outlet.
__kernel void routing_fill(__global const int *restrict heads, int start, int count,
                           __global const int *restrict receiver,
                           __global const int *restrict main_donor,
                           __global const int *restrict height, __global int *filled)
{
    const int path = (int)get_global_id(0);
    if (path >= count)
        return;
    const int head = heads[start + path];
    const int below = receiver[head];
    int level = below == head ? height[head] : filled[below];
    for (int cell = head; cell >= 0; cell = main_donor[cell]) {
        level = max(level, height[cell]);
        filled[cell] = level;
    }
}

// The outlet that each cell drains to.
__kernel void routing_find_outlets(__global const int *restrict heads, int start, int count,
                                   __global const int *restrict receiver,
                                   __global const int *restrict main_donor,
                                   __global int *outlet_of)
{
    const int path = (int)get_global_id(0);
    if (path >= count)
        return;
    const int head = heads[start + path];
    const int below = receiver[head];
    const int end = below == head ? head : outlet_of[below];
    for (int cell = head; cell >= 0; cell = main_donor[cell])
        outlet_of[cell] = end;
}

// The numbers of axial and of diagonal steps to the outlet, and the length of both.
__kernel void routing_measure(__global const int *restrict heads, int start, int count,
                              __global const int *restrict receiver,
                              __global const int *restrict main_donor, __global int *axial,
                              __global int *diagonal, __global float *length, int cols)
{
    const int path = (int)get_global_id(0);
    if (path >= count)
        return;
    const int head = heads[start + path];
    int below = receiver[head];
    int straight = below == head ? 0 : axial[below];
    int slanting = below == head ? 0 : diagonal[below];
    for (int cell = head; cell >= 0; cell = main_donor[cell]) {
        const int step = abs(cell - below);
        const bool slants = step != cols && cell / cols != below / cols;
        straight += step && !slants ? 1 : 0;
        slanting += slants ? 1 : 0;
        axial[cell] = straight;
        diagonal[cell] = slanting;
        length[cell] = (float)straight + (float)slanting * SQRT2;
        below = cell;
    }
}

// --- sweeps from the sources down -------------------------------------------------------------
// The levels in reverse: each work-item walks down one path, to its head. What joins the path from
// the side was written by a later level, hence an earlier launch.

// Sum a weight over all cells upstream. The donors are added in the order of their numbers, so that
// floating point, too, gives the same everywhere.
#define SUM(NAME, TYPE)                                                                       \
    __kernel void NAME(__global const int *restrict heads, int start, int count,              \
                       __global const int *restrict receiver,                                 \
                       __global const int *restrict main_donor,                               \
                       __global const TYPE *restrict weight, __global TYPE *total, int rows,  \
                       int cols)                                                              \
    {                                                                                         \
        const int path = (int)get_global_id(0);                                               \
        if (path >= count)                                                                    \
            return;                                                                           \
        const int head = heads[start + path];                                                 \
        int cell = head;                                                                      \
        while (main_donor[cell] >= 0)                                                         \
            cell = main_donor[cell];                                                          \
        for (;;) {                                                                            \
            const int row = cell / cols;                                                      \
            const int col = cell - row * cols;                                                \
            TYPE sum = weight[cell];                                                          \
            DONORS(ANYWHERE, if (drains) sum = sum + total[donor];)                           \
            total[cell] = sum;                                                                \
            if (cell == head)                                                                 \
                break;                                                                        \
            cell = receiver[cell];                                                            \
        }                                                                                     \
    }

SUM(routing_sum_int, int)
SUM(routing_sum_float, float)
