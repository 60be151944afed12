// How many values of a field are not finite. Integer atomics, so the order does not matter.

__kernel void survey_not_finite(
    __global const int *bits, __global int *counter, const int size, const int run)
{
    const int first = (int)get_global_id(0) * run;
    const int end = min(first + run, size);
    int count = 0;
    for (int i = first; i < end; ++i) count += (bits[i] & 0x7f800000) == 0x7f800000;
    if (count) atomic_add(counter, count);
}
