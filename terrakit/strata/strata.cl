// Which bed crops out: a property of it, cell by cell. Twin of exposure.py.

// Position in a column of beds that repeats; depth may be negative.
__attribute__((always_inline)) inline int strata_within(int depth, int total, float per_total)
{
    int rest = depth - (int)((float)depth * per_total) * total;
    rest += rest < 0 ? total : 0;
    rest -= rest >= total ? total : 0;
    return rest;
}

// total is 0 where the column does not repeat.
__attribute__((always_inline)) inline float strata_value(
    __global const int *bases, __global const float *values, int beds, int depth, int total,
    float per_total)
{
    const int position = total ? strata_within(depth, total, per_total) : depth;
    float value = values[0];
    for (int k = 1; k < beds; ++k) {
        value = position >= bases[k - 1] ? values[k] : value;
    }
    return value;
}

// STRATA_FIELD: the factor differs from cell to cell.
__kernel void strata_expose(
    __global const int *bedrock,
    __global const int *datum,
    __global const int *bases,
    __global const float *values,
    __global const float *factor,
    __global float *exposed,
    const int lift,
    const int beds,
    const int total,
    const float per_total,
    const int count,
    const int run)
{
    const int first = (int)get_global_id(0) * run;
    const int last = first + run < count ? first + run : count;
    _Pragma("clang loop vectorize(assume_safety)")
    for (int i = first; i < last; ++i) {
        const int depth = datum[i] + lift - bedrock[i];
#ifdef STRATA_FIELD
        const float scale = factor[i];
#else
        const float scale = factor[0];
#endif
        exposed[i] = scale * strata_value(bases, values, beds, depth, total, per_total);
    }
}
