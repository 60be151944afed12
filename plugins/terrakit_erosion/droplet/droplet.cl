// Droplet erosion in integer heights. Twin of reference.py.
//
// The drops of a batch walk over ground that stands still. What they take and lay down is added to
// pending[], in whole parts of a quantum, at the four corners of the cell that they are in. After
// the batch two passes spread it with the brush, exchange by exchange, so that no part is lost,
// and whole quanta go into the heights. Additions of integers have no order.
// DROPLET_PARTS: parts in a quantum of height. DROPLET_SPAN: drops that a work-item walks.

// Places in the list of settings; droplet/plan.py packs them in this order.
#define DROPLET_KEEP 0          // share of its direction that a drop keeps on a step
#define DROPLET_RISE 1          // slope for each quantum of height over one step
#define DROPLET_SPEED_KEPT 2    // share of v^2 left after a step
#define DROPLET_SPEED_GAINED 3  // v^2 gained on a step for each unit of slope
#define DROPLET_CAPACITY 4      // load for each unit of water, speed and slope
#define DROPLET_LEAST_SLOPE 5   // slope that counts for the capacity where the ground is flatter
#define DROPLET_TAKEN 6         // share of the missing load taken up on a step
#define DROPLET_SETTLED 7       // share of the excess load that settles on a step
#define DROPLET_WATER_KEPT 8    // share of the water left after a step
#define DROPLET_WATER 9         // parts of water in a drop, for each metre of rain
#define DROPLET_DIP 10          // parts that raise the middle of the brush by a quantum
#define DROPLET_BITE 11         // most parts that a place gets or loses in a batch, over its slope
#define DROPLET_ENERGY 12       // v^2 at the start

#define DROPLET_MOST 268435456.0f  // parts that one drop may carry: 2^28
#define DROPLET_COUNTS 16.0f       // smoothed visits are in sixteenths
#define DROPLET_NO_WATER (-1073741824)
#define DROPLET_BELOW_ONE 0.99999994f

// How a walk ends; also the row of left[] in which the load is booked.
#define DROPLET_DRY 0
#define DROPLET_NORTH 1
#define DROPLET_SOUTH 2
#define DROPLET_WEST 3
#define DROPLET_EAST 4
#define DROPLET_SEA 5
#define DROPLET_GOES_ON 6

#define DROPLET_INLINE __attribute__((always_inline)) inline
#define DROPLET_FAST _Pragma("clang loop vectorize(assume_safety)")

// On a CPU a work-item walks several drops side by side, in loops that the compiler turns into
// vector code (the library's functions are calls, which leave loops scalar), and begins the next
// where one ends. Elsewhere it walks one.
#ifdef TERRAKIT_CPU
#define DROPLET_LANES 8
#define DROPLET_ADD(place, amount) __sync_fetch_and_add(place, amount)
#define DROPLET_SQRT(x) __builtin_sqrtf(x)
#else
#define DROPLET_LANES 1
#define DROPLET_ADD(place, amount) atomic_add(place, amount)
#define DROPLET_SQRT(x) sqrt(x)
#endif

typedef struct {
    int row, col;       // the cell that it is in
    float down, right;  // where in the cell, 0 to 1
    float south, east;  // direction, of length 1 or 0
    float above;        // height above the lowest place so far, quanta
    int idle;           // steps since it was at its lowest
    float rise;         // of the ground over the last step, quanta
    float depth;        // of water that stood where the step began, quanta; 0 where it was dry
} droplet_drop;

typedef struct {
    __global const int *height;    // quanta
    __global const int *level;     // to which water fills hollows, quanta
    __global const int *receiver;  // the neighbour by which water leaves
    float keep;
    int crossing;                  // whether level[] and receiver[] are there
    int sea;                       // height of the sea, quanta
    int open;                      // whether drops leave over the border
    int patience;                  // steps without getting lower after which a drop ends
    int rows, cols;
} droplet_ground;

// Drops that walk side by side.
typedef struct {
    int row[DROPLET_LANES], col[DROPLET_LANES];
    float down[DROPLET_LANES], right[DROPLET_LANES];
    float south[DROPLET_LANES], east[DROPLET_LANES];
    float above[DROPLET_LANES];
    int idle[DROPLET_LANES];
} droplet_lanes;

DROPLET_INLINE droplet_drop droplet_taken(const droplet_lanes *lanes, int lane)
{
    const droplet_drop drop = {
        lanes->row[lane], lanes->col[lane], lanes->down[lane], lanes->right[lane],
        lanes->south[lane], lanes->east[lane], lanes->above[lane], lanes->idle[lane], 0.0f, 0.0f};
    return drop;
}

DROPLET_INLINE void droplet_put(droplet_lanes *lanes, int lane, const droplet_drop *drop)
{
    lanes->row[lane] = drop->row;
    lanes->col[lane] = drop->col;
    lanes->down[lane] = drop->down;
    lanes->right[lane] = drop->right;
    lanes->south[lane] = drop->south;
    lanes->east[lane] = drop->east;
    lanes->above[lane] = drop->above;
    lanes->idle[lane] = drop->idle;
}

// Where along an axis a drop falls, cell and fraction: somewhere in its own part of the map.
DROPLET_INLINE float droplet_place(int part, int parts, uint bits, int cells, int *cell)
{
    const ulong whole = ((ulong)part << 32) + bits;
    const ulong place = whole * (ulong)cells / (ulong)parts;
    *cell = (int)(place >> 32);
    return exact_uniform((uint)place);
}

// Drop number slot of a batch, where it falls.
DROPLET_INLINE droplet_drop droplet_begin(
    uint seed_low, uint seed_high, int batch, int slot, int tall, int wide, int rows, int cols)
{
    droplet_drop drop = {0, 0, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0, 0.0f, 0.0f};
    const uint bits = exact_hash(seed_low, seed_high, batch, slot);
    const int part = slot / wide;
    drop.down = droplet_place(part, tall, bits, rows - 1, &drop.row);
    drop.right = droplet_place(
        slot - part * wide, wide, exact_mix(bits ^ 0x9e3779b9u), cols - 1, &drop.col);
    return drop;
}

DROPLET_INLINE int droplet_nearest(const droplet_drop *drop, int cols)
{
    return (drop->row + (drop->down >= 0.5f)) * cols + drop->col + (drop->right >= 0.5f);
}

// Without what is so small that its square is no normal float.
DROPLET_INLINE float droplet_flushed(float x) { return x > -1e-10f && x < 1e-10f ? 0.0f : x; }

// Move by one step along the direction.
DROPLET_INLINE void droplet_shift(droplet_drop *drop)
{
    const float down = drop->down + drop->south;
    const float right = drop->right + drop->east;
    const int rows = down < 0.0f ? -1 : (down >= 1.0f ? 1 : 0);
    const int cols = right < 0.0f ? -1 : (right >= 1.0f ? 1 : 0);
    const float lower = droplet_flushed(down - (float)rows);
    const float further = droplet_flushed(right - (float)cols);
    drop->row += rows;
    drop->col += cols;
    drop->down = lower < DROPLET_BELOW_ONE ? lower : DROPLET_BELOW_ONE;
    drop->right = further < DROPLET_BELOW_ONE ? further : DROPLET_BELOW_ONE;
}

// Point the drop to the neighbour by which water leaves the nearest point.
DROPLET_INLINE void droplet_follow(
    droplet_drop *drop, const droplet_ground *ground, int nearest, int which)
{
    const int away = ground->receiver[nearest] - nearest;
    const int rows = away > 1 ? 1 : (away < -1 ? -1 : 0);  // there are three columns or more
    const int cols = away - rows * ground->cols;
    const float south = (float)((drop->down >= 0.5f) + rows) - drop->down;
    const float east = (float)((drop->right >= 0.5f) + cols) - drop->right;
    const float length = DROPLET_SQRT(south * south + east * east);
    const int leads = which && away != 0 && length > 1e-6f;
    const float unit = leads ? length : 1.0f;
    drop->south = leads ? droplet_flushed(south / unit) : drop->south;
    drop->east = leads ? droplet_flushed(east / unit) : drop->east;
}

DROPLET_INLINE int droplet_side(const droplet_drop *drop, int rows, int cols)
{
    return drop->row < 0 ? DROPLET_NORTH
        : drop->row > rows - 2 ? DROPLET_SOUTH
        : drop->col < 0 ? DROPLET_WEST
        : drop->col > cols - 2 ? DROPLET_EAST
        : DROPLET_GOES_ON;
}

// Bring a drop that went over a closed border back to it.
DROPLET_INLINE void droplet_return(droplet_drop *drop, int rows, int cols)
{
    const int above = drop->row < 0;
    const int below = drop->row > rows - 2;
    const int before = drop->col < 0;
    const int beyond = drop->col > cols - 2;
    drop->row = above ? 0 : (below ? rows - 2 : drop->row);
    drop->down = above ? 0.0f : (below ? DROPLET_BELOW_ONE : drop->down);
    drop->col = before ? 0 : (beyond ? cols - 2 : drop->col);
    drop->right = before ? 0.0f : (beyond ? DROPLET_BELOW_ONE : drop->right);
}

// Height of the ground above base, so that no float is large; anywhere outside, of the first cell.
DROPLET_INLINE float droplet_height(
    const droplet_drop *drop, const droplet_ground *ground, int base, int is_inside)
{
    __global const int *at =
        ground->height + (is_inside ? drop->row * ground->cols + drop->col : 0);
    const float a = (float)(at[0] - base);
    const float b = (float)(at[1] - base);
    const float c = (float)(at[ground->cols] - base);
    const float d = (float)(at[ground->cols + 1] - base);
    const float upper = a + (b - a) * drop->right;
    const float lower = c + (d - c) * drop->right;
    return upper + (lower - upper) * drop->down;
}

// One step of the walk. It depends on the ground alone, not on speed, water or load, so that both
// walks of a batch take the same way.
DROPLET_INLINE int droplet_step(droplet_drop *drop, const droplet_ground *ground)
{
    const int cols = ground->cols;
    const int nearest = droplet_nearest(drop, cols);
    __global const int *at = ground->height + drop->row * cols + drop->col;
    const int base = at[0];
    const float b = (float)(at[1] - base);
    const float c = (float)(at[cols] - base);
    const float d = (float)(at[cols + 1] - base);
    const float to_east = b + (d - c - b) * drop->down;
    const float to_south = c + (d - b - c) * drop->right;
    const float upper = b * drop->right;
    const float lower = c + (d - c) * drop->right;
    const float here = upper + (lower - upper) * drop->down;

    int in_lake = 0;
    int surface = ground->sea;
    if (ground->crossing) {
        const int level = ground->level[nearest];
        in_lake = level > ground->height[nearest];
        surface = in_lake ? level : surface;
    }
    const float depth = (float)(surface - base) - here;
    const int wet = depth > 0.0f;
    drop->depth = wet ? depth : 0.0f;

    // Downhill, with some inertia; in a lake to its outlet; in the sea straight on
    const float steep = DROPLET_SQRT(to_east * to_east + to_south * to_south);
    const int slopes = !in_lake && !wet && steep > 0.0f;
    const float turn = (1.0f - ground->keep) / (slopes ? steep : 1.0f);
    const float east = ground->keep * drop->east - turn * to_east;
    const float south = ground->keep * drop->south - turn * to_south;
    const float length = DROPLET_SQRT(east * east + south * south);
    const int turns = slopes && length > 1e-6f;
    const float unit = turns ? length : 1.0f;
    drop->east = turns ? droplet_flushed(east / unit) : drop->east;
    drop->south = turns ? droplet_flushed(south / unit) : drop->south;
    if (ground->crossing) {
        const int lost = drop->east == 0.0f && drop->south == 0.0f;
        droplet_follow(drop, ground, nearest, in_lake || lost);
    }
    const int moves = drop->east != 0.0f || drop->south != 0.0f;

    const droplet_drop before = *drop;
    droplet_shift(drop);
    int side = droplet_side(drop, ground->rows, cols);
    float rise = droplet_height(drop, ground, base, side == DROPLET_GOES_ON) - here;
    if (ground->crossing) {
        const int again = side == DROPLET_GOES_ON && !in_lake && !wet && rise >= 0.0f;
        if (again) {  // a pit between samples
            *drop = before;
            droplet_follow(drop, ground, nearest, 1);
            droplet_shift(drop);
            side = droplet_side(drop, ground->rows, cols);
            rise = droplet_height(drop, ground, base, side == DROPLET_GOES_ON) - here;
        }
    }
    if (ground->open) {  // the slope goes on beyond the border
        const float beyond = to_east * drop->east + to_south * drop->south;
        rise = side == DROPLET_GOES_ON ? rise : beyond;
    } else {
        droplet_return(drop, ground->rows, cols);
        rise = side == DROPLET_GOES_ON ? rise : droplet_height(drop, ground, base, 1) - here;
        side = DROPLET_GOES_ON;
    }
    drop->rise = moves ? rise : 0.0f;

    const float above = drop->above + rise;
    const int lowest = above < 0.0f || in_lake;
    drop->above = lowest ? 0.0f : above;
    drop->idle = lowest ? 0 : drop->idle + 1;
    const int ended = wet ? DROPLET_SEA : DROPLET_DRY;
    const int goes = drop->idle <= ground->patience ? DROPLET_GOES_ON : ended;
    return !moves ? DROPLET_DRY : (side == DROPLET_GOES_ON ? goes : side);
}

// Keep the level of water where there is any now: ground that erosion lowers later is no lake.
__kernel void droplet_dry(__global const int *height, __global int *level, const int cells)
{
    const int i = (int)get_global_id(0);
    if (i < cells && level[i] <= height[i]) level[i] = DROPLET_NO_WATER;
}

// First walk: count how often each place is visited in this batch.
__kernel void droplet_count(
    __global const int *height,
    __global const int *level,
    __global const int *receiver,
    __global int *visits,
    __global const float *rain,
    __global const float *settings,
    const uint seed_low,
    const uint seed_high,
    const int batch,
    const int tall,
    const int wide,
    const int steps,
    const int rain_field,
    const int crossing,
    const int sea,
    const int open,
    const int patience,
    const int rows,
    const int cols)
{
    const droplet_ground ground = {
        height, level, receiver, settings[DROPLET_KEEP], crossing, sea, open, patience, rows, cols};
    int next = (int)get_global_id(0) * DROPLET_SPAN;
    const int last = next + DROPLET_SPAN < tall * wide ? next + DROPLET_SPAN : tall * wide;
    droplet_lanes lanes;
    int steps_left[DROPLET_LANES];
    int places[DROPLET_LANES];
    int ends[DROPLET_LANES];
    const droplet_drop nobody = {0, 0, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0, 0.0f, 0.0f};
    for (int lane = 0; lane < DROPLET_LANES; ++lane) {
        droplet_put(&lanes, lane, &nobody);
        steps_left[lane] = 0;
    }
    for (;;) {
        int busy = 0;
        for (int lane = 0; lane < DROPLET_LANES; ++lane) {
            while (steps_left[lane] == 0 && next < last) {
                const droplet_drop drop =
                    droplet_begin(seed_low, seed_high, batch, next, tall, wide, rows, cols);
                const float water =
                    settings[DROPLET_WATER] * rain[droplet_nearest(&drop, cols) * rain_field];
                droplet_put(&lanes, lane, &drop);
                steps_left[lane] = water > 1e-6f ? steps : 0;
                ++next;
            }
            busy += steps_left[lane];
        }
        if (busy == 0) return;
        DROPLET_FAST
        for (int lane = 0; lane < DROPLET_LANES; ++lane) {
            droplet_drop drop = droplet_taken(&lanes, lane);
            places[lane] = droplet_nearest(&drop, cols);
            ends[lane] = droplet_step(&drop, &ground);
            droplet_put(&lanes, lane, &drop);
        }
        for (int lane = 0; lane < DROPLET_LANES; ++lane) {
            if (steps_left[lane] > 0) DROPLET_ADD(visits + places[lane], 1);
            const int goes_on = steps_left[lane] > 0 && ends[lane] == DROPLET_GOES_ON;
            steps_left[lane] = goes_on ? steps_left[lane] - 1 : 0;
            if (steps_left[lane] == 0) droplet_put(&lanes, lane, &nobody);
        }
    }
}

DROPLET_INLINE float droplet_least(float a, float b) { return a < b ? a : b; }

// Add an amount to the four corners around a place; the last takes what rounding left.
DROPLET_INLINE void droplet_scatter(
    __global int *pending, int corner, int cols, float down, float right, int amount)
{
    if (amount == 0) return;
    const float whole = (float)amount;
    const float up = 1.0f - down;
    const float left = 1.0f - right;
    const int a = (int)(whole * (up * left));
    const int b = (int)(whole * (up * right));
    const int c = (int)(whole * (down * left));
    DROPLET_ADD(pending + corner, a);
    DROPLET_ADD(pending + corner + 1, b);
    DROPLET_ADD(pending + corner + cols, c);
    DROPLET_ADD(pending + corner + cols + 1, amount - a - b - c);
}

// Take up to wanted parts from the four corners, each as far as the ground that the brush reaches
// from there gives way; return what was taken.
DROPLET_INLINE int droplet_take(
    __global int *cuts, __global const float *gives, int corner, int cols, float down, float right,
    float wanted)
{
    const float up = 1.0f - down;
    const float left = 1.0f - right;
    const int a = (int)(wanted * (up * left) * gives[corner]);
    const int b = (int)(wanted * (up * right) * gives[corner + 1]);
    const int c = (int)(wanted * (down * left) * gives[corner + cols]);
    const int d = (int)(wanted * (down * right) * gives[corner + cols + 1]);
    DROPLET_ADD(cuts + corner, -a);
    DROPLET_ADD(cuts + corner + 1, -b);
    DROPLET_ADD(cuts + corner + cols, -c);
    DROPLET_ADD(cuts + corner + cols + 1, -d);
    return a + b + c + d;
}

// Second walk: take up and lay down.
__kernel void droplet_carry(
    __global const int *height,
    __global const int *level,
    __global const int *receiver,
    __global const int *visits,
    __global int *pending,
    __global int *cuts,
    __global const float *gives,
    __global long *left,
    __global const float *rain,
    __global const float *settings,
    const uint seed_low,
    const uint seed_high,
    const int batch,
    const int tall,
    const int wide,
    const int steps,
    const int rain_field,
    const int crossing,
    const int sea,
    const int open,
    const int patience,
    const int laid_down,
    const int hard,
    const int rows,
    const int cols)
{
    const droplet_ground ground = {
        height, level, receiver, settings[DROPLET_KEEP], crossing, sea, open, patience, rows, cols};
    const float rise_to_slope = settings[DROPLET_RISE];
    const float speed_kept = settings[DROPLET_SPEED_KEPT];
    const float speed_gained = settings[DROPLET_SPEED_GAINED];
    const float capacity_a_water = settings[DROPLET_CAPACITY];
    const float least_slope = settings[DROPLET_LEAST_SLOPE];
    const float share_taken = settings[DROPLET_TAKEN];
    const float share_settled = settings[DROPLET_SETTLED];
    const float water_kept = settings[DROPLET_WATER_KEPT];
    const float dip = settings[DROPLET_DIP];
    const float bite = settings[DROPLET_BITE];
    int next = (int)get_global_id(0) * DROPLET_SPAN;
    const int last = next + DROPLET_SPAN < tall * wide ? next + DROPLET_SPAN : tall * wide;
    droplet_lanes lanes;
    int slots[DROPLET_LANES], steps_left[DROPLET_LANES], ends[DROPLET_LANES];
    int corners[DROPLET_LANES], loads[DROPLET_LANES], laid[DROPLET_LANES];
    int shares[4][DROPLET_LANES];
    float downs[DROPLET_LANES], rights[DROPLET_LANES], cut[DROPLET_LANES];
    float waters[DROPLET_LANES], energies[DROPLET_LANES], depths[DROPLET_LANES];
    const droplet_drop nobody = {0, 0, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0, 0.0f, 0.0f};
    for (int lane = 0; lane < DROPLET_LANES; ++lane) {
        droplet_put(&lanes, lane, &nobody);
        steps_left[lane] = loads[lane] = 0;
        waters[lane] = energies[lane] = 0.0f;
    }
    for (;;) {
        int busy = 0;
        for (int lane = 0; lane < DROPLET_LANES; ++lane) {
            while (steps_left[lane] == 0 && next < last) {
                const droplet_drop drop =
                    droplet_begin(seed_low, seed_high, batch, next, tall, wide, rows, cols);
                const float water =
                    settings[DROPLET_WATER] * rain[droplet_nearest(&drop, cols) * rain_field];
                droplet_put(&lanes, lane, &drop);
                steps_left[lane] = water > 1e-6f ? steps : 0;
                slots[lane] = next;
                waters[lane] = water;
                energies[lane] = settings[DROPLET_ENERGY];
                loads[lane] = 0;
                ++next;
            }
            busy += steps_left[lane];
        }
        if (busy == 0) return;

        DROPLET_FAST
        for (int lane = 0; lane < DROPLET_LANES; ++lane) {
            droplet_drop drop = droplet_taken(&lanes, lane);
            corners[lane] = drop.row * cols + drop.col;
            downs[lane] = drop.down;
            rights[lane] = drop.right;
            const float guard = DROPLET_COUNTS / (float)visits[droplet_nearest(&drop, cols)];
            ends[lane] = droplet_step(&drop, &ground);
            droplet_put(&lanes, lane, &drop);
            depths[lane] = drop.depth;

            const float carried = (float)loads[lane];
            const float water = waters[lane];
            const float energy = energies[lane];
            const float slope = -drop.rise * rise_to_slope;
            const float steep = slope > least_slope ? slope : least_slope;
            const float capacity = droplet_least(
                capacity_a_water * steep * DROPLET_SQRT(energy) * water, DROPLET_MOST);
            // In standing water, uphill (into the dip just left), and where there is too much
            const float in_water =
                droplet_least(carried * share_settled, drop.depth * dip * guard);
            const float uphill = droplet_least(carried, drop.rise * dip * guard);
            const float excess =
                droplet_least((carried - capacity) * share_settled, steep * bite * guard);
            const int wet = drop.depth > 0.0f;
            const int rises = drop.rise > 0.0f;
            const int takes = !wet && !rises && !(carried > capacity);
            const float more =
                droplet_least((capacity - carried) * share_taken, slope * bite * guard);
            const int settles = (int)(wet ? in_water : (rises ? uphill : excess));
            const int lays = takes ? (hard ? 0 : -(int)more) : settles;
            laid[lane] = lays;
            cut[lane] = takes ? more : 0.0f;

            // Shares of the four corners; the last takes what rounding left
            const float whole = (float)lays;
            const float up = 1.0f - downs[lane];
            const float west = 1.0f - rights[lane];
            const int a = (int)(whole * (up * west));
            const int b = (int)(whole * (up * rights[lane]));
            const int c = (int)(whole * (downs[lane] * west));
            shares[0][lane] = a;
            shares[1][lane] = b;
            shares[2][lane] = c;
            shares[3][lane] = lays - a - b - c;

            const float gained = energy * speed_kept + slope * speed_gained;
            energies[lane] = !wet && gained > 1e-20f ? gained : 0.0f;
            waters[lane] = water * water_kept;
        }

        for (int lane = 0; lane < DROPLET_LANES; ++lane) {
            if (steps_left[lane] == 0) {  // nobody walks in it, but it must not leave the map
                droplet_put(&lanes, lane, &nobody);
                continue;
            }
            if (hard && cut[lane] > 0.0f) {
                loads[lane] += droplet_take(
                    cuts, gives, corners[lane], cols, downs[lane], rights[lane], cut[lane]);
            }
            loads[lane] -= laid[lane];
            if (laid[lane] != 0) {
                __global int *corner = pending + corners[lane];
                DROPLET_ADD(corner, shares[0][lane]);
                DROPLET_ADD(corner + 1, shares[1][lane]);
                DROPLET_ADD(corner + cols, shares[2][lane]);
                DROPLET_ADD(corner + cols + 1, shares[3][lane]);
            }
            --steps_left[lane];
            if (ends[lane] == DROPLET_GOES_ON && steps_left[lane] > 0) continue;

            int end = ends[lane];
            if (end == DROPLET_GOES_ON) {
                end = depths[lane] > 0.0f && !crossing ? DROPLET_SEA : DROPLET_DRY;
            }
            if (laid_down && end == DROPLET_DRY) {
                const int corner = lanes.row[lane] * cols + lanes.col[lane];
                droplet_scatter(
                    pending, corner, cols, lanes.down[lane], lanes.right[lane], loads[lane]);
                loads[lane] = 0;
            }
            left[end * tall * wide + slots[lane]] += loads[lane];
            steps_left[lane] = 0;
            droplet_put(&lanes, lane, &nobody);
        }
    }
}

// --- the brush --------------------------------------------------------------------------------
//
// On a CPU a work-item does a row, one distance of the brush after the other, in loops that the
// compiler turns into vector code; elsewhere it does a cell.

#define DROPLET_CHUNK 256

#ifdef TERRAKIT_CPU
#define DROPLET_PLACE                        \
    const int row = (int)get_global_id(0);   \
    if (row >= rows) return;                 \
    const int start = row * cols;
#else
#define DROPLET_PLACE                        \
    const int col = (int)get_global_id(0);   \
    const int row = (int)get_global_id(1);   \
    if (row >= rows || col >= cols) return;  \
    const int i = row * cols + col;
#endif

// Smooth the visits along rows. The weight of a point itself is 1.
__kernel void droplet_smooth_rows(
    __global const int *visits,
    __global float *smooth,
    __global const float *weights,
    const int reach,
    const int rows,
    const int cols)
{
    DROPLET_PLACE
#ifdef TERRAKIT_CPU
    __global const int *from = visits + start;
    __global float *to = smooth + start;
    DROPLET_FAST
    for (int col = 0; col < cols; ++col) to[col] = (float)from[col];
    for (int k = 1; k <= reach; ++k) {
        const float weight = weights[k];
        const int west = k < cols - k ? k : cols - k;    // the first with a neighbour to the west
        const int east = k > cols - k ? k : cols - k;
        for (int col = 0; col < west; ++col) to[col] += (float)from[col + k] * weight;
        DROPLET_FAST
        for (int col = k; col < cols - k; ++col) {
            to[col] += (float)(from[col - k] + from[col + k]) * weight;
        }
        for (int col = east; col < cols; ++col) to[col] += (float)from[col - k] * weight;
    }
#else
    float sum = (float)visits[i];
    for (int k = 1; k <= reach; ++k) {
        const int west = col >= k ? visits[i - k] : 0;
        const int east = col + k < cols ? visits[i + k] : 0;
        sum += (float)(west + east) * weights[k];
    }
    smooth[i] = sum;
#endif
}

DROPLET_INLINE int droplet_counted(float sum)
{
    const float counted = sum * DROPLET_COUNTS;
    const float held = counted < 1e9f ? counted : 1e9f;
    return (int)(held > DROPLET_COUNTS ? held : DROPLET_COUNTS);
}

// The same along columns: how many visits a place shares its ground with, 1 or more, in sixteenths.
__kernel void droplet_smooth_columns(
    __global const float *smooth,
    __global int *visits,
    __global const float *weights,
    const int reach,
    const int rows,
    const int cols)
{
    DROPLET_PLACE
#ifdef TERRAKIT_CPU
    for (int chunk = 0; chunk < cols; chunk += DROPLET_CHUNK) {
        const int width = cols - chunk < DROPLET_CHUNK ? cols - chunk : DROPLET_CHUNK;
        __global const float *from = smooth + start + chunk;
        __global int *to = visits + start + chunk;
        float sum[DROPLET_CHUNK];
        DROPLET_FAST
        for (int col = 0; col < width; ++col) sum[col] = from[col];
        for (int k = 1; k <= reach; ++k) {
            const float weight = weights[k];
            const float has_north = row >= k ? 1.0f : 0.0f;
            const float has_south = row + k < rows ? 1.0f : 0.0f;
            __global const float *north = row >= k ? from - k * cols : from;
            __global const float *south = row + k < rows ? from + k * cols : from;
            DROPLET_FAST
            for (int col = 0; col < width; ++col) {
                sum[col] += (north[col] * has_north + south[col] * has_south) * weight;
            }
        }
        DROPLET_FAST
        for (int col = 0; col < width; ++col) to[col] = droplet_counted(sum[col]);
    }
#else
    float sum = smooth[i];
    for (int k = 1; k <= reach; ++k) {
        const float north = row >= k ? smooth[i - k * cols] : 0.0f;
        const float south = row + k < rows ? smooth[i + k * cols] : 0.0f;
        sum += (north + south) * weights[k];
    }
    visits[i] = droplet_counted(sum);
#endif
}

// Spread what is pending along rows.
__kernel void droplet_spread_rows(
    __global const int *pending,
    __global int *spread,
    __global const float *weights,
    const int reach,
    const int rows,
    const int cols)
{
    DROPLET_PLACE
#ifdef TERRAKIT_CPU
    __global const int *from = pending + start;
    __global int *to = spread + start;
    DROPLET_FAST
    for (int col = 0; col < cols; ++col) to[col] = from[col];
    for (int k = 1; k <= reach; ++k) {
        const float weight = weights[k];
        DROPLET_FAST
        for (int col = k; col < cols; ++col) {
            to[col] += (int)((float)from[col - k] * weight) - (int)((float)from[col] * weight);
        }
        DROPLET_FAST
        for (int col = 0; col < cols - k; ++col) {
            to[col] += (int)((float)from[col + k] * weight) - (int)((float)from[col] * weight);
        }
    }
#else
    const int own = pending[i];
    int sum = own;
    for (int k = 1; k <= reach; ++k) {
        const int gives = (int)((float)own * weights[k]);
        if (col >= k) sum += (int)((float)pending[i - k] * weights[k]) - gives;
        if (col + k < cols) sum += (int)((float)pending[i + k] * weights[k]) - gives;
    }
    spread[i] = sum;
#endif
}

// Put whole quanta into the height; the rest stays pending. Held points pass it on.
DROPLET_INLINE void droplet_settle(
    __global int *height, __global int *loose, __global int *pending, __global long *held,
    int sum, int open, int row, int col, int rows, int cols)
{
    const int i = row * cols + col;
    if (open && (row == 0 || row == rows - 1 || col == 0 || col == cols - 1)) {
        const int place = row == 0 ? col
            : row == rows - 1 ? cols + col
            : col == 0 ? 2 * cols + row
            : 2 * cols + rows + row;
        held[place] += sum;
        pending[i] = 0;
        return;
    }
    const int whole = sum / DROPLET_PARTS;
    const int thick = loose[i] + whole;
    height[i] += whole;
    loose[i] = thick > 0 ? thick : 0;
    pending[i] = sum - whole * DROPLET_PARTS;
}

// Spread along columns, and apply. removed[]: what hard ground lost, or nothing.
__kernel void droplet_apply(
    __global const int *spread,
    __global const int *removed,
    __global int *pending,
    __global int *height,
    __global int *loose,
    __global long *held,
    __global const float *weights,
    const int reach,
    const int hard,
    const int open,
    const int rows,
    const int cols)
{
    DROPLET_PLACE
#ifdef TERRAKIT_CPU
    for (int chunk = 0; chunk < cols; chunk += DROPLET_CHUNK) {
        const int width = cols - chunk < DROPLET_CHUNK ? cols - chunk : DROPLET_CHUNK;
        __global const int *from = spread + start + chunk;
        int sum[DROPLET_CHUNK];
        DROPLET_FAST
        for (int col = 0; col < width; ++col) sum[col] = from[col];
        for (int k = 1; k <= reach; ++k) {
            const float weight = weights[k];
            __global const int *north = row >= k ? from - k * cols : from;
            __global const int *south = row + k < rows ? from + k * cols : from;
            DROPLET_FAST
            for (int col = 0; col < width; ++col) {
                const int gives = (int)((float)from[col] * weight);
                const int gets = (int)((float)north[col] * weight);
                const int also = (int)((float)south[col] * weight);
                sum[col] += gets + also - 2 * gives;
            }
        }
        for (int col = 0; col < width; ++col) {
            const int total = sum[col] + (hard ? removed[start + chunk + col] : 0);
            droplet_settle(
                height, loose, pending, held, total, open, row, chunk + col, rows, cols);
        }
    }
#else
    const int own = spread[i];
    int sum = own + (hard ? removed[i] : 0);
    for (int k = 1; k <= reach; ++k) {
        const int gives = (int)((float)own * weights[k]);
        if (row >= k) sum += (int)((float)spread[i - k * cols] * weights[k]) - gives;
        if (row + k < rows) sum += (int)((float)spread[i + k * cols] * weights[k]) - gives;
    }
    droplet_settle(height, loose, pending, held, sum, open, row, col, rows, cols);
#endif
}

// --- banks and plains ---------------------------------------------------------------------------

// What flows from one point to another: banks steeper than they can stand slump, loose material
// levels out as far as there is any. Seen from the other point it is the exact negative.
DROPLET_INLINE int droplet_flux(
    __global const int *height, __global const int *loose, __global const float *bed, int hard,
    int i, int j, int bank, float slumps, float levels)
{
    const int d = height[i] - height[j];
    const int fall = d > 0 ? d : -d;
    const float donor = (float)(d > 0 ? loose[i] : loose[j]);
    const int beyond = fall - bank;
    const float gives = hard ? (d > 0 ? bed[i] : bed[j]) : 1.0f;
    const float share = slumps * (gives < 1.0f ? gives : 1.0f);
    const int slumped = (int)(share * (float)(beyond > 0 ? beyond : 0));
    const float level = levels * (float)fall;
    const float most = donor * 0.1f;
    const int flux = slumped + (int)(level < most ? level : most);
    return d > 0 ? flux : -flux;
}

DROPLET_INLINE void droplet_lower(
    __global int *result, __global int *loose_after, __global long *held,
    __global const int *height, __global const int *loose,
    int flux, int open, int row, int col, int rows, int cols)
{
    const int i = row * cols + col;
    const int border = row == 0 || row == rows - 1 || col == 0 || col == cols - 1;
    if (open && border) {
        const int place = row == 0 ? col
            : row == rows - 1 ? cols + col
            : col == 0 ? 2 * cols + row
            : 2 * cols + rows + row;
        held[place] -= (long)flux * DROPLET_PARTS;
        flux = 0;
    }
    const int thick = loose[i] - flux;
    result[i] = height[i] - flux;
    loose_after[i] = thick > 0 ? thick : 0;
}

// One sweep. Axial neighbours count four times as much as diagonal ones, which is isotropic.
__kernel void droplet_rest(
    __global const int *height,
    __global const int *loose,
    __global const float *bed,
    __global int *result,
    __global int *loose_after,
    __global long *held,
    const int bank,
    const int bank_aslant,
    const float slumps,
    const float levels,
    const int hard,
    const int open,
    const int rows,
    const int cols)
{
    DROPLET_PLACE
    const float slumps_aslant = slumps * 0.25f;
    const float levels_aslant = levels * 0.25f;
#ifdef TERRAKIT_CPU
    const int inside = row > 0 && row < rows - 1;
    if (inside) {
        DROPLET_FAST
        for (int i = start + 1; i < start + cols - 1; ++i) {
            int flux = droplet_flux(height, loose, bed, hard, i, i - 1, bank, slumps, levels);
            flux += droplet_flux(height, loose, bed, hard, i, i + 1, bank, slumps, levels);
            flux += droplet_flux(height, loose, bed, hard, i, i - cols, bank, slumps, levels);
            flux += droplet_flux(height, loose, bed, hard, i, i + cols, bank, slumps, levels);
            flux += droplet_flux(
                height, loose, bed, hard, i, i - cols - 1, bank_aslant, slumps_aslant, levels_aslant);
            flux += droplet_flux(
                height, loose, bed, hard, i, i - cols + 1, bank_aslant, slumps_aslant, levels_aslant);
            flux += droplet_flux(
                height, loose, bed, hard, i, i + cols - 1, bank_aslant, slumps_aslant, levels_aslant);
            flux += droplet_flux(
                height, loose, bed, hard, i, i + cols + 1, bank_aslant, slumps_aslant, levels_aslant);
            const int thick = loose[i] - flux;
            result[i] = height[i] - flux;
            loose_after[i] = thick > 0 ? thick : 0;
        }
    }
    for (int col = 0; col < cols; col += inside ? cols - 1 : 1) {
        const int i = start + col;
#endif
        int flux = 0;
        for (int dr = -1; dr <= 1; ++dr) {
            for (int dc = -1; dc <= 1; ++dc) {
                const int away = row + dr < 0 || row + dr >= rows || col + dc < 0 || col + dc >= cols;
                if (away || (dr == 0 && dc == 0)) continue;
                const int aslant = dr != 0 && dc != 0;
                flux += droplet_flux(
                    height, loose, bed, hard, i, i + dr * cols + dc, aslant ? bank_aslant : bank,
                    aslant ? slumps_aslant : slumps, aslant ? levels_aslant : levels);
            }
        }
        droplet_lower(
            result, loose_after, held, height, loose, flux, open, row, col, rows, cols);
#ifdef TERRAKIT_CPU
    }
#endif
}

// --- hard ground --------------------------------------------------------------------------------
//
// A cut is shared among the points that the brush reaches in proportion to how far each gives way,
// so what does not give way loses nothing. What rounding leaves over stays with the cut.

// How far a point gives way: bedrock by its softness, and loose material wholly, unless it is so
// thin that a batch, which lowers no place by more than its slope allows, could take all of it.
__kernel void droplet_soften(
    __global const int *height,
    __global const int *loose,
    __global const float *bed,
    __global float *soft,
    const float shield,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (row >= rows || col >= cols) return;
    const int i = row * cols + col;
    int steepest = 1;
    for (int dr = row > 0 ? -1 : 0; dr <= (row < rows - 1 ? 1 : 0); ++dr) {
        for (int dc = col > 0 ? -1 : 0; dc <= (col < cols - 1 ? 1 : 0); ++dc) {
            const int d = height[i] - height[i + dr * cols + dc];
            steepest = d > steepest ? d : steepest;
            steepest = -d > steepest ? -d : steepest;
        }
    }
    const float thick = (float)loose[i];
    const float share = thick / (thick + shield * (float)steepest);
    const float gives = bed[i] < 2.0f ? bed[i] : 2.0f;
    soft[i] = gives + (1.0f - gives) * share;
}

// Heights without the loose material.
__kernel void droplet_bare(
    __global const int *height, __global const int *loose, __global int *bedrock, const int cells)
{
    const int i = (int)get_global_id(0);
    if (i < cells) bedrock[i] = height[i] - loose[i];
}

// Sum of the brush over a field along rows (step 1) or columns (step cols); 0 beyond the border.
__kernel void droplet_reach_columns(
    __global const float *soft,
    __global float *column,
    __global const float *weights,
    const int reach,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (row >= rows || col >= cols) return;
    const int i = row * cols + col;
    float sum = soft[i] * weights[0];
    for (int k = 1; k <= reach; ++k) {
        const float north = row >= k ? soft[i - k * cols] : 0.0f;
        const float south = row + k < rows ? soft[i + k * cols] : 0.0f;
        sum += (north + south) * weights[k];
    }
    column[i] = sum;
}

__kernel void droplet_reach_rows(
    __global const float *column,
    __global float *gives,
    __global const float *weights,
    const int reach,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (row >= rows || col >= cols) return;
    const int i = row * cols + col;
    float sum = column[i] * weights[0];
    for (int k = 1; k <= reach; ++k) {
        const float west = col >= k ? column[i - k] : 0.0f;
        const float east = col + k < cols ? column[i + k] : 0.0f;
        sum += (west + east) * weights[k];
    }
    gives[i] = sum;
}

// What a cut takes for each unit of weight and of giving way.
DROPLET_INLINE float droplet_unit(int cut, float gives)
{
    return gives > 1e-6f ? (float)cut / gives : 0.0f;
}

// Share cuts among the columns, in proportion to how far each gives way as a whole.
__kernel void droplet_cut_rows(
    __global const int *cuts,
    __global const float *gives,
    __global const float *column,
    __global int *shared_cuts,
    __global const float *weights,
    const int reach,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (row >= rows || col >= cols) return;
    const int i = row * cols + col;
    const float unit = droplet_unit(cuts[i], gives[i]);
    int sum = cuts[i];
    for (int k = 1; k <= reach; ++k) {
        if (col >= k) {
            sum += (int)(droplet_unit(cuts[i - k], gives[i - k]) * weights[k] * column[i]);
            sum -= (int)(unit * weights[k] * column[i - k]);
        }
        if (col + k < cols) {
            sum += (int)(droplet_unit(cuts[i + k], gives[i + k]) * weights[k] * column[i]);
            sum -= (int)(unit * weights[k] * column[i + k]);
        }
    }
    shared_cuts[i] = sum;
}

// Share them within the columns, in proportion to how far each point gives way.
__kernel void droplet_cut_columns(
    __global const int *shared_cuts,
    __global const float *column,
    __global const float *soft,
    __global int *cuts,
    __global int *removed,
    __global const float *weights,
    const int reach,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (row >= rows || col >= cols) return;
    const int i = row * cols + col;
    const float unit = droplet_unit(shared_cuts[i], column[i]);
    int lost = (int)(unit * weights[0] * soft[i]);
    int given = lost;
    for (int k = 1; k <= reach; ++k) {
        if (row >= k) {
            const int j = i - k * cols;
            lost += (int)(droplet_unit(shared_cuts[j], column[j]) * weights[k] * soft[i]);
            given += (int)(unit * weights[k] * soft[j]);
        }
        if (row + k < rows) {
            const int j = i + k * cols;
            lost += (int)(droplet_unit(shared_cuts[j], column[j]) * weights[k] * soft[i]);
            given += (int)(unit * weights[k] * soft[j]);
        }
    }
    removed[i] = lost;
    cuts[i] = shared_cuts[i] - given;
}
