// Sums of waves, first along x, then along y. Twin of waves() in reference.py.
// The outer loops run over waves and the inner ones over columns, so every sample adds up its waves
// in the same order on every device.

// Row ky of the half-plane of waves, summed over kx: real and imaginary part for every column.
// spectrum: for ky, then kx = -most ... most, real and imaginary part.
// turn_x: for kx = 0 ... most, then columns: cosine and sine of 2 pi kx x, in two planes.
__kernel void spectral_along(
    __global float *sums,
    __global const float2 *spectrum,
    __global const float *turn_x,
    const int most,
    const int cols)
{
    const size_t plane = (size_t)(most + 1) * cols;
#ifdef TERRAKIT_CPU
    const int ky = (int)get_global_id(0);
    if (ky > most) return;
    __global float *real = sums + (size_t)ky * cols;
    __global float *imaginary = sums + plane + (size_t)ky * cols;
    for (int col = 0; col < cols; ++col) real[col] = 0.0f;
    for (int col = 0; col < cols; ++col) imaginary[col] = 0.0f;
    for (int kx = 0; kx <= most; ++kx) {
        const float2 plus = spectrum[(size_t)ky * (2 * most + 1) + most + kx];
        const float2 minus = spectrum[(size_t)ky * (2 * most + 1) + most - kx];
        __global const float *cosine = turn_x + (size_t)kx * cols;
        __global const float *sine = turn_x + plane + (size_t)kx * cols;
        const float a = plus.x + minus.x;
        const float b = plus.y - minus.y;
        const float c = plus.y + minus.y;
        const float d = plus.x - minus.x;
        _Pragma("clang loop vectorize(assume_safety)")
        for (int col = 0; col < cols; ++col) {
            real[col] = real[col] + (a * cosine[col] - b * sine[col]);
            imaginary[col] = imaginary[col] + (c * cosine[col] + d * sine[col]);
        }
    }
#else
    const int col = (int)get_global_id(0);
    const int ky = (int)get_global_id(1);
    if (col >= cols || ky > most) return;
    float real = 0.0f;
    float imaginary = 0.0f;
    for (int kx = 0; kx <= most; ++kx) {
        const float2 plus = spectrum[(size_t)ky * (2 * most + 1) + most + kx];
        const float2 minus = spectrum[(size_t)ky * (2 * most + 1) + most - kx];
        const float cosine = turn_x[(size_t)kx * cols + col];
        const float sine = turn_x[plane + (size_t)kx * cols + col];
        real = real + ((plus.x + minus.x) * cosine - (plus.y - minus.y) * sine);
        imaginary = imaginary + ((plus.y + minus.y) * cosine + (plus.x - minus.x) * sine);
    }
    sums[(size_t)ky * cols + col] = real;
    sums[plane + (size_t)ky * cols + col] = imaginary;
#endif
}

// turn_y: for ky = 0 ... most, then rows: cosine and sine of 2 pi ky y, in two planes.
__kernel void spectral_across(
    __global float *elevation,
    __global const float *sums,
    __global const float *turn_y,
    const float offset,
    const int most,
    const int rows,
    const int cols)
{
    const size_t plane = (size_t)(most + 1) * cols;
    const size_t turns = (size_t)(most + 1) * rows;
#ifdef TERRAKIT_CPU
    const int row = (int)get_global_id(0);
    if (row >= rows) return;
    __global float *line = elevation + (size_t)row * cols;
    for (int col = 0; col < cols; ++col) line[col] = 0.0f;
    for (int ky = 0; ky <= most; ++ky) {
        const float cosine = turn_y[(size_t)ky * rows + row];
        const float sine = turn_y[turns + (size_t)ky * rows + row];
        __global const float *real = sums + (size_t)ky * cols;
        __global const float *imaginary = sums + plane + (size_t)ky * cols;
        _Pragma("clang loop vectorize(assume_safety)")
        for (int col = 0; col < cols; ++col) {
            line[col] = line[col] + (cosine * real[col] - sine * imaginary[col]);
        }
    }
    for (int col = 0; col < cols; ++col) line[col] = offset + line[col];
#else
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    float sum = 0.0f;
    for (int ky = 0; ky <= most; ++ky) {
        const float cosine = turn_y[(size_t)ky * rows + row];
        const float sine = turn_y[turns + (size_t)ky * rows + row];
        const size_t at = (size_t)ky * cols + col;
        sum = sum + (cosine * sums[at] - sine * sums[plane + at]);
    }
    elevation[(size_t)row * cols + col] = offset + sum;
#endif
}
