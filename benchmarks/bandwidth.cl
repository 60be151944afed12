// How fast memory is here: the floor of every pass over a terrain.

#ifdef TERRAKIT_CPU
#define WIDE _Pragma("clang loop vectorize(assume_safety)")
#else
#define WIDE
#endif

// Each work-item takes `run` consecutive elements: many on a CPU, one on a GPU.
__kernel void bandwidth_triad(
    __global float *a,
    __global const float *b,
    __global const float *c,
    const float factor,
    const int run,
    const int count)
{
    const int first = (int)get_global_id(0) * run;
    const int last = first + run < count ? first + run : count;
    WIDE
    for (int i = first; i < last; ++i) {
        a[i] = b[i] + factor * c[i];
    }
}

__kernel void bandwidth_scale(
    __global float *a,
    const float factor,
    const int run,
    const int count)
{
    const int first = (int)get_global_id(0) * run;
    const int last = first + run < count ? first + run : count;
    WIDE
    for (int i = first; i < last; ++i) {
        a[i] = factor * a[i];
    }
}
