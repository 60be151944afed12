// Tectonic plates. Twin of reference.py; noise.cl is put before it.
// Lengths are in plate sizes, speeds in multiples of the usual speed.

#define PLATES_NEAREST 6
#define PLATES_REACH 2
#define PLATES_FAR_REACH 3
// A row of the table of sites: place in its cell, weight, motion, spin, type, age
#define PLATES_ROW 8
#define PLATES_WEIGHT 2
#define PLATES_MOTION 3
#define PLATES_SPIN 5
#define PLATES_TYPE 6
#define PLATES_AGE 7
// Shares below 2^-24 are 0, so that no product gets too small for a normal float
#define PLATES_LEAST 5.9604644775390625e-8f

typedef struct {
    float power;
    int cell;
    float east;
    float north;
} plates_site;

inline float plates_clamped(float value)
{
    const float low = value > 0.0f ? value : 0.0f;
    return low < 1.0f ? low : 1.0f;
}

inline float plates_smooth(float value)
{
    const float within = plates_clamped(value);
    const float t = within > 1e-4f ? within : 0.0f;
    return t * t * (3.0f - 2.0f * t);
}

// 2 to the power of the exponent, and 0 where that is below the least share
inline float plates_faded(float exponent)
{
    return exponent > -24.0f ? exact_exp2(exponent) : 0.0f;
}

// exp(-sharpness * squared)
inline float plates_bell(float squared, float sharpness)
{
    return plates_faded(squared * (sharpness * -1.44269504f));
}

inline float plates_square(float value)
{
    return value * value;
}

// Positive part without a crease at 0
inline float plates_eased(float closing)
{
    const float positive = closing > 1e-4f ? closing : 0.0f;
    return positive * (positive / (positive + 0.3f));
}

inline float plates_falling(float excess, float softness)
{
    return plates_faded(excess / (-2.0f * softness));
}

// A sum of octaves of noise, or of its ridges
inline float plates_fractal(
    int row,
    int col,
    __global const long *lattice,
    __global const float *weight,
    __global const uint *seeds,
    int first,
    int octaves,
    int ridged)
{
    float total = 0.0f;
    for (int k = first; k < first + octaves; ++k) {
        const long u = lattice[6 * k] + col * lattice[6 * k + 1] + row * lattice[6 * k + 2];
        const long v = lattice[6 * k + 3] + col * lattice[6 * k + 4] + row * lattice[6 * k + 5];
        const float x = (float)((uint)u >> 8) * 5.9604644775390625e-8f;
        const float y = (float)((uint)v >> 8) * 5.9604644775390625e-8f;
        float noise = noise_gradient(
            (int)(u >> 32), (int)(v >> 32), x, y, seeds[2 * k], seeds[2 * k + 1]);
        if (ridged) {
            const float ridge = 1.0f - (noise < 0.0f ? -noise : noise);
            noise = ridge * ridge;
        }
        total = total + weight[k] * noise;
    }
    return total;
}

// The site of a cell beside the sample's own, as seen from the sample
inline plates_site plates_site_at(
    int here, float x, float y, int di, int dj, __global const float *table, int cells)
{
    plates_site found;
    found.cell = here + dj * cells + di;
    found.east = table[PLATES_ROW * found.cell] + (float)di - x;
    found.north = table[PLATES_ROW * found.cell + 1] + (float)dj - y;
    found.power = found.east * found.east + found.north * found.north
                  - table[PLATES_ROW * found.cell + PLATES_WEIGHT];
    return found;
}

// Motion of a plate at the sample: v = u + omega x r, r from the site
inline float2 plates_moving(__global const float *table, plates_site site)
{
    __global const float *of = table + PLATES_ROW * site.cell;
    const float spin = of[PLATES_SPIN];
    return (float2)(of[PLATES_MOTION] + spin * site.north,
                    of[PLATES_MOTION + 1] - spin * site.east);
}

// Weights of the nearest plates that sum to 1 and are smooth across boundaries
inline void plates_shares(const plates_site *near, float softness, float *share)
{
    const float end = plates_falling(near[PLATES_NEAREST - 1].power - near[0].power, softness);
    float total = 1e-20f;
    for (int k = 0; k < PLATES_NEAREST - 1; ++k) {
        share[k] = plates_falling(near[k].power - near[0].power, softness) - end;
        total = k == 0 ? share[k] + 1e-20f : total + share[k];
    }
    for (int k = 0; k < PLATES_NEAREST - 1; ++k) share[k] = share[k] / total;
}

// Chance of each pair to be the nearest two (Plackett and Luce), in the order of the loops below
inline void plates_pair_weights(const plates_site *near, float softness, float *pairs)
{
    float share[PLATES_NEAREST - 1];
    float second[PLATES_NEAREST - 2];
    plates_shares(near, softness, share);
    const float end = plates_falling(near[PLATES_NEAREST - 1].power - near[1].power, softness);
    float others = 1e-20f;
    for (int k = 0; k < PLATES_NEAREST - 2; ++k) {
        second[k] = plates_falling(near[k + 1].power - near[1].power, softness) - end;
        others = k == 0 ? second[k] + 1e-20f : others + second[k];
    }
    int pair = 0;
    for (int i = 0; i < PLATES_NEAREST - 2; ++i) {
        for (int j = i + 1; j < PLATES_NEAREST - 1; ++j) {
            const float back = share[j] * share[i] / (1.0f - share[j] + 1e-20f);
            const float there = i == 0
                ? share[0] * (second[j - 1] / others)
                : share[i] * share[j] / (1.0f - share[i] + 1e-20f);
            const float chance = there + back;
            pairs[pair] = chance > PLATES_LEAST ? chance : 0.0f;
            ++pair;
        }
    }
}

inline void plates_at(
    __global float *made,
    const size_t plane,
    const int row,
    const int col,
    __global const long *lattice,
    __global const float *weight,
    __global const uint *seeds,
    __global const long *place,
    __global const float *table,
    __global const int *identity,
    __global const float *settings,
    const int octaves,
    const int first_i,
    const int first_j,
    const int cells)
{
    const float warp = settings[0];
    const float size = settings[1];
    const float speed = settings[2];
    const float narrow = settings[3];
    const float wide = settings[4];
    const float belt = settings[5];
    const float variation = settings[6];
    const float shelf = settings[7];
    const float slope = settings[8];
    const float continent_height = settings[9];
    const float ocean_depth = settings[10];
    const float ridge_depth = settings[11];
    const float mountain_height = settings[12];
    const float trench_depth = settings[13];
    const float rift_depth = settings[14];
    const float hills = settings[15];
    const float full_age = settings[16];
    const float lift = settings[17];
    const float medium = settings[18];

    const float bend_u = plates_fractal(row, col, lattice, weight, seeds, 0, octaves, 0);
    const float bend_v = plates_fractal(row, col, lattice, weight, seeds, octaves, octaves, 0);
    const float crust = plates_fractal(row, col, lattice, weight, seeds, 2 * octaves, octaves, 0);
    const float ridges = plates_fractal(row, col, lattice, weight, seeds, 3 * octaves, octaves, 1);
    const long u = place[0] + col * place[1] + row * place[2]
                   + (long)(int)(bend_u * warp * 16777216.0f) * 256;
    const long v = place[3] + col * place[4] + row * place[5]
                   + (long)(int)(bend_v * warp * 16777216.0f) * 256;
    const float x = (float)((uint)u >> 8) * 5.9604644775390625e-8f;
    const float y = (float)((uint)v >> 8) * 5.9604644775390625e-8f;
    const int here = ((int)(v >> 32) - first_j) * cells + ((int)(u >> 32) - first_i);

    // The nearest sites in the power distance, in turn; of equals the first found
    plates_site near[PLATES_NEAREST];
    for (int k = 0; k < PLATES_NEAREST; ++k) {
        near[k].power = 1e9f;
        near[k].cell = here;
        near[k].east = 0.0f;
        near[k].north = 0.0f;
    }
    for (int dj = -PLATES_REACH; dj <= PLATES_REACH; ++dj) {
        for (int di = -PLATES_REACH; di <= PLATES_REACH; ++di) {
            plates_site found = plates_site_at(here, x, y, di, dj, table, cells);
            for (int k = 0; k < PLATES_NEAREST; ++k) {
                if (found.power < near[k].power) {
                    const plates_site moved = near[k];
                    near[k] = found;
                    found = moved;
                }
            }
        }
    }
    const plates_site owner = near[0];

    // The nearest boundary of the plate
    float least = 1e9f;
    plates_site beyond = owner;
    for (int dj = -PLATES_FAR_REACH; dj <= PLATES_FAR_REACH; ++dj) {
        for (int di = -PLATES_FAR_REACH; di <= PLATES_FAR_REACH; ++di) {
            const plates_site found = plates_site_at(here, x, y, di, dj, table, cells);
            if (found.cell == owner.cell) continue;
            const float east = found.east - owner.east;
            const float north = found.north - owner.north;
            const float apart = sqrt(east * east + north * north);
            const float half_way = (found.power - owner.power) / (2.0f * apart);
            if (half_way < least) {
                least = half_way;
                beyond = found;
            }
        }
    }
    least = least > 0.0f ? least : 0.0f;

    // How much each of the nearest plates has a say: sharp for belts, wide for crust, and between
    // the two for the age of the ocean floor
    float sharp[(PLATES_NEAREST - 1) * (PLATES_NEAREST - 2) / 2];
    float broad[(PLATES_NEAREST - 1) * (PLATES_NEAREST - 2) / 2];
    float share[PLATES_NEAREST - 1];
    plates_pair_weights(near, narrow, sharp);
    plates_pair_weights(near, medium, broad);
    plates_shares(near, wide, share);
    const float wander = variation * crust;
    float crustal = 0.0f;
    float local_crust[PLATES_NEAREST - 1];
    float2 motion[PLATES_NEAREST - 1];
    for (int k = 0; k < PLATES_NEAREST - 1; ++k) {
        const float type = table[PLATES_ROW * near[k].cell + PLATES_TYPE];
        crustal = crustal + share[k] * type;
        local_crust[k] = plates_smooth((type - 0.5f + wander) * 2.0f + 0.5f);
        motion[k] = plates_moving(table, near[k]);
    }

    float coast = crustal - 0.5f + wander;
    float youth = 0.0f;
    float mountains = 0.0f;
    float arcs = 0.0f;
    float trench = 0.0f;
    float rift = 0.0f;
    float convergence = 0.0f;
    float shear = 0.0f;
    float uplift = 0.0f;
    int pair = 0;
    for (int i = 0; i < PLATES_NEAREST - 2; ++i) {
        for (int j = i + 1; j < PLATES_NEAREST - 1; ++j) {
            const float to_east = near[j].east - near[i].east;
            const float to_north = near[j].north - near[i].north;
            const float apart = sqrt(to_east * to_east + to_north * to_north);
            const float east = to_east / apart;
            const float north = to_north / apart;
            const float along = (near[j].power - near[i].power) / (2.0f * apart);
            const float z = along / belt;
            const float du = motion[i].x - motion[j].x;
            const float dv = motion[i].y - motion[j].y;
            const float closing = du * east + dv * north;
            const float sliding = dv * east - du * north;
            const float say = sharp[pair];
            convergence = convergence + say * closing;
            shear = shear + say * sliding;
            const float pushed = plates_eased(closing);
            const float pull = plates_eased(-closing);
            const float push = pushed / (pushed + 0.8f) * 1.6f;
            const float opened = pull / (pull + 0.8f) * 1.6f;
            const float both = local_crust[i] * local_crust[j];
            const float mine = local_crust[i] * (1.0f - local_crust[j]);
            const float other = local_crust[j] * (1.0f - local_crust[i]);
            const float neither = (1.0f - local_crust[i]) * (1.0f - local_crust[j]);
            // Of two oceans the older floor goes under
            const float mine_up = table[PLATES_ROW * near[i].cell + PLATES_AGE]
                < table[PLATES_ROW * near[j].cell + PLATES_AGE] ? 1.0f : 0.0f;
            const float z2 = z * z;

            // Continents that meet: a broad range on both sides
            const float wall = 0.75f * plates_bell(z2, 1.0f) + 0.25f * plates_bell(z2, 0.16f);
            const float broad_wall = 0.6f * plates_bell(z2 / (0.4f + push), 1.0f)
                + 0.4f * plates_bell(z2 / (0.4f + push), 0.2f);
            // Ocean under continent: an arc inland, a trench at sea
            const float arc_mine = plates_bell(plates_square(z - 1.1f), 2.0f);
            const float arc_other = plates_bell(plates_square(z + 1.1f), 2.0f);
            const float deep_mine = plates_bell(plates_square(z - 0.3f), 14.0f);
            const float deep_other = plates_bell(plates_square(z + 0.3f), 14.0f);
            const float chain = mine * arc_mine + other * arc_other;
            mountains = mountains + say * push * (both * broad_wall + 0.8f * chain);
            trench = trench + say * push * (
                (mine + neither * mine_up) * deep_other
                + (other + neither * (1.0f - mine_up)) * deep_mine);
            arcs = arcs + say * push * neither * (
                mine_up * arc_mine + (1.0f - mine_up) * arc_other);
            // Continents that part: a valley with raised shoulders, in the end a narrow sea
            rift = rift + say * opened * both * (
                0.4f * plates_bell(plates_square(z2 - 1.0f), 3.0f) - plates_bell(z2, 6.0f));
            coast = coast + say * (
                push * (both * 0.35f * plates_bell(z2, 0.4f))
                + push * (mine - other) * 0.5f * z * plates_bell(z2, 0.5f)
                - opened * both * 0.3f * plates_bell(z2, 4.0f));
            const float lifted = closing * (closing > 0.0f ? 1.0f : 0.0f);
            uplift = uplift + say * lifted * (both * wall + 0.5f * chain);

            // Oceans that part: the floor sinks as the square root of its age
            const float distance = sqrt(along * along + 0.01f * belt * belt);
            const float age = distance / (0.5f * pull * full_age + 1e-6f);
            const float sunk = age / sqrt(1.0f + age * age);
            youth = youth + broad[pair] * neither * (1.0f - sqrt(sunk));
            ++pair;
        }
    }

    const float floor_depth = ocean_depth - (ocean_depth - ridge_depth) * youth;
    const float land = plates_clamped(coast * 3.0f);
    const float shoal = plates_clamped(-coast / shelf);
    const float drop = plates_smooth((-coast - shelf) / slope);
    const float upland = plates_smooth(crust * 1.2f + 0.35f);
    const float ground = continent_height * land * (0.4f + 1.3f * upland) - 150.0f * shoal;
    const float base = ground + drop * (150.0f - floor_depth);
    const float grain = (0.2f + 0.8f * ridges) * (0.6f + 0.4f * upland);
    float height = base + mountain_height * mountains * grain;
    height = height + 0.9f * ocean_depth * arcs * ridges;
    height = height - trench_depth * trench * (0.25f + 0.75f * drop);
    height = height + rift_depth * rift;
    height = height + hills * (ridges - 0.45f) * (0.1f + upland) * (0.25f + 0.75f * land);

    // The plate under the sample and what happens at the boundary that is nearest to it
    const float to_east = beyond.east - owner.east;
    const float to_north = beyond.north - owner.north;
    const float apart = sqrt(to_east * to_east + to_north * to_north);
    const float east = to_east / apart;
    const float north = to_north / apart;
    const float2 mine = plates_moving(table, owner);
    const float2 theirs = plates_moving(table, beyond);
    const float du = mine.x - theirs.x;
    const float dv = mine.y - theirs.y;
    const float closing = du * east + dv * north;
    const float sliding = dv * east - du * north;
    const float fast = closing < 0.0f ? -closing : closing;
    const float swift = sliding < 0.0f ? -sliding : sliding;
    const float own = table[PLATES_ROW * owner.cell + PLATES_TYPE];
    const float their = table[PLATES_ROW * beyond.cell + PLATES_TYPE];
    const float meeting = own * their > 0.0f ? 1.0f : 2.0f;
    const float parting = own + their > 0.0f ? 3.0f : 4.0f;
    const float kind = fast > 0.36f * swift ? (closing > 0.0f ? meeting : parting) : 5.0f;
    const int still = fast + swift == 0.0f || least > belt || speed == 0.0f;

    made[0] = height;
    made[plane] = (float)identity[owner.cell];
    made[2 * plane] = own;
    made[3 * plane] = mine.x * speed;
    made[4 * plane] = mine.y * speed;
    made[5 * plane] = least * size;
    made[6 * plane] = convergence * speed;
    made[7 * plane] = shear * speed;
    made[8 * plane] = still ? 0.0f : kind;
    made[9 * plane] = uplift * lift;
}

// lattice: six longs an octave: u at the first sample, per column, per row; the same for v.
// place: the same six for the lattice of the plates. made: one plane a layer.
__kernel void plates_make(
    __global float *made,
    __global const long *lattice,
    __global const float *weight,
    __global const uint *seeds,
    __global const long *place,
    __global const float *table,
    __global const int *identity,
    __global const float *settings,
    const int octaves,
    const int first_i,
    const int first_j,
    const int cells,
    const int rows,
    const int cols)
{
    const size_t plane = (size_t)rows * cols;
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    for (int col = 0; col < cols; ++col) {
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    {
#endif
        plates_at(
            made + (size_t)row * cols + col, plane, row, col, lattice, weight, seeds, place, table,
            identity, settings, octaves, first_i, first_j, cells);
    }
}
