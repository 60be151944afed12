// Wind over sand and rock, in integer heights. Twin of reference.py.
//
// Sand flies by hops that are the same for all cells in one gust, so that it is gathered from one
// place. Whatever slides or flies is a whole number of quanta and is the exact negative of what
// the other side sees, so nothing is lost and the order of additions does not matter.
// WIND_FIELDS: vegetation and softness vary from cell to cell.
// WIND_VEER: relief turns the wind aside, so that sand comes in from five places.

#ifdef WIND_FIELDS
#define VARYING(field, i) field[i]
#else
#define VARYING(field, i) field[0]
#endif

typedef struct {
    int talus;             // difference to an axial neighbour that holds, quanta
    int talus_slanted;
    float axial;           // share of what is beyond it that slides in one gust
    float slanted;
    float creep_axial;     // share of any difference that creeps under flying grains
    float creep_slanted;
    float on_rock;         // share of the flying sand that one hop lays down
    float on_sand;
    float per_cover;       // 1 / thickness of sand that counts as sand, quanta
    float per_shelter;     // 1 / depth in the lee at which all sand falls, quanta
} WindLaws;

// A coordinate inside the map: around it, or held at its border. k is off by one size at most.
__attribute__((always_inline)) inline int wind_inside(int k, int size, int periodic)
{
    const int low = k < 0 ? (periodic ? k + size : 0) : k;
    return low >= size ? (periodic ? low - size : size - 1) : low;
}

// Volume that slides and creeps from here to there, the exact negative of that from there to
// here. Of its sand a cell gives at most an eighth to each neighbour.
__attribute__((always_inline)) inline int wind_slide(
    int here, int there, int sand_here, int sand_there, int talus, float share, float creep)
{
    const int d = here - there;
    const int down = d - talus;
    const int up = -d - talus;
    const int beyond = (down > 0 ? down : 0) - (up > 0 ? up : 0);
    const int wanted = (int)(share * (float)beyond + creep * (float)d);
    const int most = sand_here >> 3;
    const int least = -(sand_there >> 3);
    return wanted > most ? most : (wanted < least ? least : wanted);
}

#define WIND_SLIDE(offset, talus, share, creep) \
    { \
        const int sand_there = sand[i + (offset)]; \
        const int out = wind_slide( \
            h, bedrock[i + (offset)] + sand_there, s, sand_there, talus, share, creep); \
        net += out; \
        gross += out > 0 ? out : 0; \
    }

// One gust at one cell. The offsets of its neighbours are 0 where there is none.
__attribute__((always_inline)) inline void wind_cell(
    __global const int *bedrock, __global const int *sand, __global const int *lift,
    __global const float *plants, __global const int *shade, __global int *sand_after,
    __global int *air_after, int i, int n, int s_, int w, int e, int nw, int ne, int sw, int se,
    int arrived, WindLaws laws)
{
    const int s = sand[i];
    const int h = bedrock[i] + s;
    int net = 0;
    int gross = 0;
    WIND_SLIDE(n, laws.talus, laws.axial, laws.creep_axial)
    WIND_SLIDE(s_, laws.talus, laws.axial, laws.creep_axial)
    WIND_SLIDE(w, laws.talus, laws.axial, laws.creep_axial)
    WIND_SLIDE(e, laws.talus, laws.axial, laws.creep_axial)
    WIND_SLIDE(nw, laws.talus_slanted, laws.slanted, laws.creep_slanted)
    WIND_SLIDE(ne, laws.talus_slanted, laws.slanted, laws.creep_slanted)
    WIND_SLIDE(sw, laws.talus_slanted, laws.slanted, laws.creep_slanted)
    WIND_SLIDE(se, laws.talus_slanted, laws.slanted, laws.creep_slanted)
    // Land: more readily on sand than on rock, among plants, and in the lee
    const int above = shade[i] - h;
    const float below = (float)(above > 0 ? above : 0) * laws.per_shelter;
    const float shelter = below < 1.0f ? below : 1.0f;
    const float cover = (float)s * laws.per_cover;
    const float bare = laws.on_rock
                     + (laws.on_sand - laws.on_rock) * (cover < 1.0f ? cover : 1.0f);
    const float green = bare + (1.0f - bare) * VARYING(plants, i);
    const float caught = green + (1.0f - green) * shelter;
    const int falls = (int)(caught * (float)arrived);
    const int laid = falls < arrived ? falls : arrived;
    // Take off again, where the wind reaches
    const int there = s - gross;
    const int wanted = (int)((1.0f - shelter) * (float)lift[i]);
    const int lifted = wanted < there ? wanted : there;
    sand_after[i] = s - net + laid - lifted;
    air_after[i] = arrived - laid + lifted;
}

#ifdef WIND_VEER
// Sand that veers by k cells across the wind, out of the cell from which it does.
__attribute__((always_inline)) inline int wind_veered(
    __global const int *air, __global const int *veer, int row, int col, int down, int right,
    int across_row, int across_col, int k, int inflow, int periodic, int rows, int cols)
{
    const int r = row - down - k * across_row;
    const int c = col - right - k * across_col;
    const int known = r >= 0 && r < rows && c >= 0 && c < cols;
    if (!known && !periodic) return k == 0 ? inflow : 0;
    const int j = wind_inside(r, rows, 1) * cols + wind_inside(c, cols, 1);
    return veer[j] == k ? air[j] : 0;
}
#endif

// One gust: sand flies in from (row - down, col - right), lands and is lifted, slopes slide.
// gone: what flew out over open borders, counted where it flew from.
__kernel void wind_blow(
    __global const int *bedrock,
    __global const int *sand,
    __global const int *air,
    __global const int *shade,
    __global const int *lift,
    __global const float *plants,
    __global const int *veer,
    __global int *sand_after,
    __global int *air_after,
    __global long *gone,
    const int down,
    const int right,
    const int across_row,
    const int across_col,
    const int inflow,
    const int talus,
    const int talus_slanted,
    const float axial,
    const float slanted,
    const float creep_axial,
    const float creep_slanted,
    const float on_rock,
    const float on_sand,
    const float per_cover,
    const float per_shelter,
    const int periodic,
    const int rows,
    const int cols)
{
    const WindLaws laws = {talus, talus_slanted, axial, slanted, creep_axial, creep_slanted,
                           on_rock, on_sand, per_cover, per_shelter};
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
#else
    const int column = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (row >= rows || column >= cols) return;
#endif
    const int start = row * cols;
    const int n = row > 0 ? -cols : (periodic ? (rows - 1) * cols : 0);
    const int s = row < rows - 1 ? cols : (periodic ? (1 - rows) * cols : 0);
    const int from = row - down;
    const int is_known = periodic || (from >= 0 && from < rows);
    const int source = (wind_inside(from, rows, 1) * cols - right) - start;
#ifdef TERRAKIT_CPU
#ifdef WIND_VEER
    const int first = 0;
    const int last = 0;
#else
    // Cells with all their neighbours, whose sand comes from inside the map
    const int first = right > 1 ? right : 1;
    const int last = is_known ? (right < -1 ? cols + right : cols - 1) : 0;
    const int nw = n ? n - 1 : 0;
    const int ne = n ? n + 1 : 0;
    const int sw = s ? s - 1 : 0;
    const int se = s ? s + 1 : 0;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int i = start + first; i < start + last; ++i) {
        wind_cell(bedrock, sand, lift, plants, shade, sand_after, air_after, i, n, s, -1, 1,
                  nw, ne, sw, se, air[i + source], laws);
    }
    if (!periodic) {
        const int all_leave = row + down < 0 || row + down >= rows;
        const int west = all_leave ? cols : (right < 0 ? -right : 0);
        const int east = right > 0 ? cols - right : cols;
        for (int col = 0; col < cols; ++col) {
            if (col == west && west < east) col = east;
            if (col < cols) gone[start + col] += air[start + col];
        }
    }
#endif
    for (int col = 0; col < cols; ++col) {
        if (col == first && first < last) col = last;
#else
    const int col = column;
    {
#endif
        const int i = start + col;
        const int w = col > 0 ? -1 : (periodic ? cols - 1 : 0);
        const int e = col < cols - 1 ? 1 : (periodic ? 1 - cols : 0);
        const int c = col - right;
        const int inside = is_known && (periodic || (c >= 0 && c < cols));
        const int j = wind_inside(from, rows, 1) * cols + wind_inside(c, cols, 1);
#ifdef WIND_VEER
        int arrived = 0;
        for (int k = -2; k <= 2; ++k) {
            arrived += wind_veered(air, veer, row, col, down, right, across_row, across_col, k,
                                   inflow, periodic, rows, cols);
        }
#else
        const int arrived = inside ? air[j] : inflow;
#endif
#if defined(WIND_VEER) || !defined(TERRAKIT_CPU)
#ifdef WIND_VEER
        const int aside = veer[i];
#else
        const int aside = 0;
#endif
        const int to_row = row + down + aside * across_row;
        const int to_col = col + right + aside * across_col;
        const int stays = to_row >= 0 && to_row < rows && to_col >= 0 && to_col < cols;
        if (!periodic && !stays) gone[i] += air[i];
#endif
        wind_cell(bedrock, sand, lift, plants, shade, sand_after, air_after, i, n, s, w, e,
                  n && w ? n + w : 0, n && e ? n + e : 0, s && w ? s + w : 0, s && e ? s + e : 0,
                  arrived, laws);
    }
}

// Height of the ground, from which shadows start.
__kernel void wind_ground(
    __global const int *bedrock, __global const int *sand, __global int *shade, const int cells)
{
    const int i = (int)get_global_id(0);
    if (i < cells) shade[i] = bedrock[i] + sand[i];
}

// Shadows reach once as far again: what lies in the lee is below a line that sinks downwind.
__kernel void wind_shade(
    __global const int *shade,
    __global int *further,
    const int down,
    const int right,
    const int sinks,
    const int periodic,
    const int rows,
    const int cols)
{
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
#else
    const int column = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (row >= rows || column >= cols) return;
#endif
    // Held at an open border, it starts from a cell of the border itself
    const int m = row * cols;
    const int from = wind_inside(row - down, rows, periodic) * cols;
#ifdef TERRAKIT_CPU
    const int first = right > 0 ? right : 0;
    const int last = right < 0 ? cols + right : cols;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int col = first; col < last; ++col) {
        const int line = shade[from + col - right] - sinks;
        further[m + col] = shade[m + col] > line ? shade[m + col] : line;
    }
    for (int col = 0; col < cols; ++col) {
        if (col == first && first < last) col = last;
        if (col == cols) break;
#else
    const int col = column;
    {
#endif
        const int line = shade[from + wind_inside(col - right, cols, periodic)] - sinks;
        further[m + col] = shade[m + col] > line ? shade[m + col] : line;
    }
}

// The wind's stream runs over the ground, and over the hollows behind dunes.
__kernel void wind_stream(__global const int *shade, __global float *stream, const int cells)
{
    const int i = (int)get_global_id(0);
    if (i < cells) stream[i] = (float)shade[i];
}

#define WIND_FIVE(m, b, c, a, d) \
    (0.375f * field[m] + 0.25f * (field[b] + field[c]) + 0.0625f * (field[a] + field[d]))

// Spline of five samples that lie one or two steps of (down, right) away.
__kernel void wind_smooth(
    __global const float *field,
    __global float *result,
    const int down,
    const int right,
    const int down_twice,
    const int right_twice,
    const int periodic,
    const int rows,
    const int cols)
{
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
#else
    const int column = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (row >= rows || column >= cols) return;
#endif
    const int m = row * cols;
    const int a = wind_inside(row - down_twice, rows, periodic) * cols;
    const int b = wind_inside(row - down, rows, periodic) * cols;
    const int c = wind_inside(row + down, rows, periodic) * cols;
    const int d = wind_inside(row + down_twice, rows, periodic) * cols;
#ifdef TERRAKIT_CPU
    const int edge = right_twice < 0 ? -right_twice : right_twice;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int col = edge; col < cols - edge; ++col) {
        result[m + col] = WIND_FIVE(m + col, b + col - right, c + col + right,
                                    a + col - right_twice, d + col + right_twice);
    }
    for (int col = 0; col < cols; ++col) {
        if (col == edge && edge < cols - edge) col = cols - edge;
        if (col == cols) break;
#else
    const int col = column;
    {
#endif
        result[m + col] = WIND_FIVE(
            m + col, b + wind_inside(col - right, cols, periodic),
            c + wind_inside(col + right, cols, periodic),
            a + wind_inside(col - right_twice, cols, periodic),
            d + wind_inside(col + right_twice, cols, periodic));
    }
}

// The stress by which relief of one size raises the wind's: how far the ground stands out.
__kernel void wind_press(
    __global const float *field,
    __global const float *smooth,
    __global float *stress,
    const float weight,
    const int is_first,
    const int cells)
{
    const int i = (int)get_global_id(0);
    if (i >= cells) return;
    const float before = is_first ? 1.0f : stress[i];
    stress[i] = before + weight * (field[i] - smooth[i]);
}

// How much sand a gust lifts from every cell, and how much rock the grains of many gusts wear.
__kernel void wind_lift(
    __global const float *near,
    __global const float *wide,
    __global const float *stress,
    __global const float *plants,
    __global const float *softness,
    __global int *bedrock,
    __global int *sand,
    __global const int *air,
    __global const int *shade,
    __global int *lift,
    __global int *veer,
    __global long *dust,
    const float rise_row,
    const float rise_col,
    const float climb_row,
    const float climb_col,
    const float aside_row,
    const float aside_col,
    const float height_rate,
    const float lowest,
    const float calm,
    const float steepest,
    const float most,
    const float threshold,
    const float amount,
    const float wears,
    const float dusty,
    const float per_cover,
    const float per_shelter,
    const float per_flight,
    const uint seed_low,
    const uint seed_high,
    const int periodic,
    const int rows,
    const int cols)
{
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
#else
    const int column = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (row >= rows || column >= cols) return;
#endif
    const int m = row * cols;
    const int n = wind_inside(row - 1, rows, periodic) * cols;
    const int s = wind_inside(row + 1, rows, periodic) * cols;
#ifdef TERRAKIT_CPU
    for (int col = 0; col < cols; ++col) {
#else
    const int col = column;
    {
#endif
        const int i = m + col;
        const int w = m + wind_inside(col - 1, cols, periodic);
        const int e = m + wind_inside(col + 1, cols, periodic);
        const float to_south = near[s + col] - near[n + col];
        const float to_east = near[e] - near[w];
        // Stress: the relief's, the slope's, and that of height
        const float bump = stress[i] - 1.0f;
        const float rise = rise_row * to_south + rise_col * to_east;
        const float slope = rise < steepest ? rise : steepest;
        const float speed = 1.0f + height_rate * (near[i] - lowest);
        const float raw = (1.0f + (bump < 0.0f ? calm * bump : bump) + slope) * (speed * speed);
        const float pull = raw > 0.0f ? (raw < most ? raw : most) : 0.0f;
        const float excess = sqrt(pull) - threshold;
        const float carries = amount * pull * (excess > 0.0f ? excess : 0.0f);
        const uint hash = exact_hash(seed_low, seed_high, row, col);
        const float gusty = 0.95f + 0.1f * exact_uniform(hash);
        lift[i] = (int)(carries * gusty * (1.0f - VARYING(plants, i)));
        // Grains fly low and wear what faces them, where no sand lies and no lee is
        if (wears > 0.0f) {
            const int ground = bedrock[i] + sand[i];
            const float cover = (float)sand[i] * per_cover;
            const float below = (float)(shade[i] > ground ? shade[i] - ground : 0) * per_shelter;
            const float bare = (cover < 1.0f ? 1.0f - cover : 0.0f)
                             * (below < 1.0f ? 1.0f - below : 0.0f);
            const float climb = climb_row * to_south + climb_col * to_east;
            const float facing = climb > -0.25f ? 0.25f + climb : 0.0f;
            const float above = (near[i] - wide[i]) * per_flight;
            const float reach = above > 0.0f ? 1.0f / (1.0f + above * above) : 1.0f;
            const float worn = wears * (float)air[i] * bare * facing * reach
                             * VARYING(softness, i);
            const int rock = (int)(worn < 16777216.0f ? worn : 16777216.0f);
            const int fine = (int)(dusty * (float)rock);
            bedrock[i] -= rock;
            sand[i] += rock - fine;
            dust[i] += fine;
        }
#ifdef WIND_VEER
        // Aside from what rises beside the path, near and wide
        const float near_aside = aside_row * to_south + aside_col * to_east;
        const float wide_aside = aside_row * (wide[s + col] - wide[n + col])
                               + aside_col * (wide[e] - wide[w]);
        const float shift = near_aside + 3.0f * wide_aside;
        const float held = shift > 2.0f ? 2.0f : (shift < -2.0f ? -2.0f : shift);
        const int cells = (int)exact_floor(held + exact_uniform(exact_mix(hash)));
        veer[i] = cells > 2 ? 2 : (cells < -2 ? -2 : cells);
#endif
    }
}
