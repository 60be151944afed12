// Goes after noise.cl. Twin of reference.py.

// Cellular noise (Worley 1996): distances to points, one anywhere in each cell, in cells.
// Inside, a cell is 2^32 wide, so that hashes are offsets from its middle as they are.
typedef struct {
    float f1, f2, f3, f4;  // what the metric measures, ascending
    uint nearest;          // hash of the nearest point; of equally near ones the first
} noise_near;

#define NOISE_SIDE 4294967296.0f

NOISE float noise_least(float a, float b)
{
    return a < b ? a : b;
}

NOISE float noise_most(float a, float b)
{
    return a > b ? a : b;
}

NOISE void noise_keep(noise_near *near, float apart, uint hash)
{
    near->nearest = apart < near->f1 ? hash : near->nearest;
    const float beyond_1 = noise_most(near->f1, apart);
    near->f1 = noise_least(near->f1, apart);
    const float beyond_2 = noise_most(near->f2, beyond_1);
    near->f2 = noise_least(near->f2, beyond_1);
    const float beyond_3 = noise_most(near->f3, beyond_2);
    near->f3 = noise_least(near->f3, beyond_2);
    near->f4 = noise_least(near->f4, beyond_3);
}

// What each metric measures, something that grows with the distance, and the distance from that.
#define NOISE_APART_euclidean(x, y) ((x) * (x) + (y) * (y))
#define NOISE_LENGTH_euclidean(apart) (noise_root(apart) * 2.3283064365386963e-10f)
#define NOISE_APART_euclidean_squared(x, y) ((x) * (x) + (y) * (y))
#define NOISE_LENGTH_euclidean_squared(apart) ((apart) * 5.421010862427522e-20f)
#define NOISE_APART_manhattan(x, y) (noise_magnitude(x) + noise_magnitude(y))
#define NOISE_LENGTH_manhattan(apart) ((apart) * 2.3283064365386963e-10f)
#define NOISE_APART_chebyshev(x, y) noise_most(noise_magnitude(x), noise_magnitude(y))
#define NOISE_LENGTH_chebyshev(apart) ((apart) * 2.3283064365386963e-10f)
#define NOISE_APART_minkowski_half(x, y) \
    (noise_root(noise_magnitude(x)) + noise_root(noise_magnitude(y)))
#define NOISE_LENGTH_minkowski_half(apart) ((apart) * (apart) * 2.3283064365386963e-10f)

#define NOISE_VISIT(metric, column, across, row, down)                       \
    {                                                                        \
        const uint hash = (column) * (row);                                  \
        const float to_x = (across) + (float)(int)hash;                      \
        const float to_y = (down) + (float)(int)(hash << 11);                \
        noise_keep(&near, NOISE_APART_##metric(to_x, to_y), hash);           \
    }

// Four by four cells about the nearest corner of the lattice: what is outside is 1.5 away.
// Five by five about the cell: what is outside is 2 away.
#define NOISE_LINES(n, lines, product, step, seed, start, from)                              \
    const uint lines##n = noise_line((product) + (n##u) * (step), seed);                     \
    const float lines##_at##n = ((start) + (n##.0f) * NOISE_SIDE) - (from) * NOISE_SIDE;
#define NOISE_VISIT_4(metric, n)                                             \
    NOISE_VISIT(metric, column0, column_at0, row##n, row_at##n)              \
    NOISE_VISIT(metric, column1, column_at1, row##n, row_at##n)              \
    NOISE_VISIT(metric, column2, column_at2, row##n, row_at##n)              \
    NOISE_VISIT(metric, column3, column_at3, row##n, row_at##n)
#define NOISE_VISIT_5(metric, n)                                             \
    NOISE_VISIT_4(metric, n)                                                 \
    NOISE_VISIT(metric, column4, column_at4, row##n, row_at##n)

#define NOISE_SEARCHES(metric)                                                                  \
    NOISE noise_near noise_search_4_##metric(                                                   \
        int i, int j, float x, float y, uint low, uint high)                                    \
    {                                                                                           \
        const uint column_seed = noise_column_seed(low);                                        \
        const uint row_seed = noise_row_seed(low, high);                                        \
        const uint columns = ((uint)i - (x < 0.5f ? 2u : 1u)) * NOISE_COLUMN;                   \
        const uint rows = ((uint)j - (y < 0.5f ? 2u : 1u)) * NOISE_ROW;                         \
        const float west = x < 0.5f ? -1.5f * NOISE_SIDE : -0.5f * NOISE_SIDE;                  \
        const float south = y < 0.5f ? -1.5f * NOISE_SIDE : -0.5f * NOISE_SIDE;                 \
        NOISE_LINES(0, column, columns, NOISE_COLUMN, column_seed, west, x)                     \
        NOISE_LINES(1, column, columns, NOISE_COLUMN, column_seed, west, x)                     \
        NOISE_LINES(2, column, columns, NOISE_COLUMN, column_seed, west, x)                     \
        NOISE_LINES(3, column, columns, NOISE_COLUMN, column_seed, west, x)                     \
        NOISE_LINES(0, row, rows, NOISE_ROW, row_seed, south, y)                                \
        NOISE_LINES(1, row, rows, NOISE_ROW, row_seed, south, y)                                \
        NOISE_LINES(2, row, rows, NOISE_ROW, row_seed, south, y)                                \
        NOISE_LINES(3, row, rows, NOISE_ROW, row_seed, south, y)                                \
        noise_near near = {1e30f, 1e30f, 1e30f, 1e30f, 0u};                                     \
        NOISE_VISIT_4(metric, 0)                                                                \
        NOISE_VISIT_4(metric, 1)                                                                \
        NOISE_VISIT_4(metric, 2)                                                                \
        NOISE_VISIT_4(metric, 3)                                                                \
        return near;                                                                            \
    }                                                                                           \
    NOISE noise_near noise_search_5_##metric(                                                   \
        int i, int j, float x, float y, uint low, uint high)                                    \
    {                                                                                           \
        const uint column_seed = noise_column_seed(low);                                        \
        const uint row_seed = noise_row_seed(low, high);                                        \
        const uint columns = ((uint)i - 2u) * NOISE_COLUMN;                                     \
        const uint rows = ((uint)j - 2u) * NOISE_ROW;                                           \
        NOISE_LINES(0, column, columns, NOISE_COLUMN, column_seed, -1.5f * NOISE_SIDE, x)       \
        NOISE_LINES(1, column, columns, NOISE_COLUMN, column_seed, -1.5f * NOISE_SIDE, x)       \
        NOISE_LINES(2, column, columns, NOISE_COLUMN, column_seed, -1.5f * NOISE_SIDE, x)       \
        NOISE_LINES(3, column, columns, NOISE_COLUMN, column_seed, -1.5f * NOISE_SIDE, x)       \
        NOISE_LINES(4, column, columns, NOISE_COLUMN, column_seed, -1.5f * NOISE_SIDE, x)       \
        NOISE_LINES(0, row, rows, NOISE_ROW, row_seed, -1.5f * NOISE_SIDE, y)                   \
        NOISE_LINES(1, row, rows, NOISE_ROW, row_seed, -1.5f * NOISE_SIDE, y)                   \
        NOISE_LINES(2, row, rows, NOISE_ROW, row_seed, -1.5f * NOISE_SIDE, y)                   \
        NOISE_LINES(3, row, rows, NOISE_ROW, row_seed, -1.5f * NOISE_SIDE, y)                   \
        NOISE_LINES(4, row, rows, NOISE_ROW, row_seed, -1.5f * NOISE_SIDE, y)                   \
        noise_near near = {1e30f, 1e30f, 1e30f, 1e30f, 0u};                                     \
        NOISE_VISIT_5(metric, 0)                                                                \
        NOISE_VISIT_5(metric, 1)                                                                \
        NOISE_VISIT_5(metric, 2)                                                                \
        NOISE_VISIT_5(metric, 3)                                                                \
        NOISE_VISIT_5(metric, 4)                                                                \
        return near;                                                                            \
    }

// Two over the range of each distance that all but a thousandth of places keep to: what is shown is
// the distance from -1 at nothing to 1 at that. reference.py holds the ranges.
#define NOISE_SPREAD_euclidean_f1 2.0f
#define NOISE_SPREAD_euclidean_f2 1.60000002f
#define NOISE_SPREAD_euclidean_f3 1.4545455f
#define NOISE_SPREAD_euclidean_f4 1.33333337f
#define NOISE_SPREAD_euclidean_gap 2.0f
#define NOISE_SPREAD_euclidean_squared_f1 2.0f
#define NOISE_SPREAD_euclidean_squared_f2 1.33333337f
#define NOISE_SPREAD_euclidean_squared_f3 1.06666672f
#define NOISE_SPREAD_euclidean_squared_f4 0.888888896f
#define NOISE_SPREAD_euclidean_squared_gap 1.4545455f
#define NOISE_SPREAD_manhattan_f1 1.60000002f
#define NOISE_SPREAD_manhattan_f2 1.33333337f
#define NOISE_SPREAD_manhattan_f3 1.14285719f
#define NOISE_SPREAD_manhattan_f4 1.0f
#define NOISE_SPREAD_manhattan_gap 1.60000002f
#define NOISE_SPREAD_chebyshev_f1 2.28571439f
#define NOISE_SPREAD_chebyshev_f2 1.77777779f
#define NOISE_SPREAD_chebyshev_f3 1.60000002f
#define NOISE_SPREAD_chebyshev_f4 1.4545455f
#define NOISE_SPREAD_chebyshev_gap 2.28571439f
#define NOISE_SPREAD_minkowski_half_f1 0.842105269f
#define NOISE_SPREAD_minkowski_half_f2 0.727272749f
#define NOISE_SPREAD_minkowski_half_f3 0.639999986f
#define NOISE_SPREAD_minkowski_half_f4 0.571428597f
#define NOISE_SPREAD_minkowski_half_gap 0.888888896f

#define NOISE_CELLULAR(suffix, metric, first, more)                                             \
    NOISE float noise_cellular_f1##suffix(int i, int j, float x, float y, uint low, uint high)  \
    {                                                                                           \
        const noise_near near = noise_search_##first##_##metric(i, j, x, y, low, high);         \
        return NOISE_LENGTH_##metric(near.f1) * NOISE_SPREAD_##metric##_f1 - 1.0f;              \
    }                                                                                           \
    NOISE float noise_cellular_f2##suffix(int i, int j, float x, float y, uint low, uint high)  \
    {                                                                                           \
        const noise_near near = noise_search_##more##_##metric(i, j, x, y, low, high);          \
        return NOISE_LENGTH_##metric(near.f2) * NOISE_SPREAD_##metric##_f2 - 1.0f;              \
    }                                                                                           \
    NOISE float noise_cellular_f3##suffix(int i, int j, float x, float y, uint low, uint high)  \
    {                                                                                           \
        const noise_near near = noise_search_##more##_##metric(i, j, x, y, low, high);          \
        return NOISE_LENGTH_##metric(near.f3) * NOISE_SPREAD_##metric##_f3 - 1.0f;              \
    }                                                                                           \
    NOISE float noise_cellular_f4##suffix(int i, int j, float x, float y, uint low, uint high)  \
    {                                                                                           \
        const noise_near near = noise_search_##more##_##metric(i, j, x, y, low, high);          \
        return NOISE_LENGTH_##metric(near.f4) * NOISE_SPREAD_##metric##_f4 - 1.0f;              \
    }                                                                                           \
    NOISE float noise_cellular_f2_minus_f1##suffix(                                             \
        int i, int j, float x, float y, uint low, uint high)                                    \
    {                                                                                           \
        const noise_near near = noise_search_##more##_##metric(i, j, x, y, low, high);          \
        const float gap = NOISE_LENGTH_##metric(near.f2) - NOISE_LENGTH_##metric(near.f1);      \
        return gap * NOISE_SPREAD_##metric##_gap - 1.0f;                                        \
    }                                                                                           \
    NOISE float noise_cellular_crackle##suffix(                                                 \
        int i, int j, float x, float y, uint low, uint high)                                    \
    {                                                                                           \
        const noise_near near = noise_search_##more##_##metric(i, j, x, y, low, high);          \
        const float gap = NOISE_LENGTH_##metric(near.f2) - NOISE_LENGTH_##metric(near.f1);      \
        return noise_least(gap * 10.0f, 1.0f) * 2.0f - 1.0f;                                    \
    }                                                                                           \
    NOISE float noise_cellular_value##suffix(                                                   \
        int i, int j, float x, float y, uint low, uint high)                                    \
    {                                                                                           \
        const noise_near near = noise_search_##first##_##metric(i, j, x, y, low, high);         \
        return noise_signed(noise_spread(near.nearest));                                        \
    }

NOISE_SEARCHES(euclidean)
NOISE_SEARCHES(euclidean_squared)
NOISE_SEARCHES(manhattan)
NOISE_SEARCHES(chebyshev)
NOISE_SEARCHES(minkowski_half)
NOISE_CELLULAR(, euclidean, 4, 5)
NOISE_CELLULAR(_euclidean_squared, euclidean_squared, 4, 5)
NOISE_CELLULAR(_manhattan, manhattan, 5, 5)
NOISE_CELLULAR(_chebyshev, chebyshev, 4, 4)
NOISE_CELLULAR(_minkowski_half, minkowski_half, 5, 5)
