// Displacement of the middles of edges. Twin of displacements() in reference.py.

// Six words an edge: the quantised places of its two ends, the lower one first.
inline uint subdivide_hash(__global const int *key, uint seed)
{
    uint hash = seed;
    for (int k = 0; k < 6; ++k) hash = exact_mix(hash ^ (uint)key[k]) + 0x9e3779b9u;
    return exact_mix(hash);
}

// Sum of four uniforms, scaled to a deviation of 1.
inline float subdivide_normal(uint first, uint second)
{
    const int sum = (int)(first & 0xffffu) + (int)(first >> 16) + (int)(second & 0xffffu)
                    + (int)(second >> 16);
    return (float)(sum - 131070) * 2.6429223e-5f;
}

__kernel void subdivide_displace(
    __global float *displacement,
    __global const int *keys,
    __global const float *length,
    const float amplitude,
    const float hurst_exponent,
    const uint seed_low,
    const uint seed_high,
    const int count)
{
    const int edge = (int)get_global_id(0);
    if (edge >= count) return;
    const uint first = subdivide_hash(keys + 6 * edge, seed_low);
    const uint second = subdivide_hash(keys + 6 * edge, seed_high);
    displacement[edge] = amplitude * exact_power(length[edge], hurst_exponent)
                         * subdivide_normal(first, second);
}
