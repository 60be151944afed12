// The brush. Twin of reference.py.
//
// Every kernel works on a window of samples that begins at sample ``first`` of the terrain, whose
// rows are ``stride`` samples apart; fields of the window alone have rows of ``cols``.

#define BRUSH_PART 9.5367431640625e-7f  // 1 / FINE of terrakit.world

#ifdef TERRAKIT_CPU
#define BRUSH_EACH(row, col) \
    const int row = (int)get_global_id(0); \
    if (row >= rows) return; \
    _Pragma("clang loop vectorize(assume_safety)") \
    for (int col = 0; col < cols; ++col)
#else
#define BRUSH_EACH(row, col) \
    const int col = (int)get_global_id(0); \
    const int row = (int)get_global_id(1); \
    if (col >= cols || row >= rows) return;
#endif

__attribute__((always_inline)) inline float brush_within(float t)
{
    return t < 0.0f ? 0.0f : (t > 1.0f ? 1.0f : t);
}

// Of the ground between two samples; none out of the brush, so that the volume is kept.
__attribute__((always_inline)) inline float brush_conductance(float here, float there)
{
    return here > 0.0f && there > 0.0f ? 0.5f * (here + there) : 0.0f;
}

// Lower the squared distance of a block of the window to the nearest of some segments.
// start: x and y in parts of a sample; along: x, y in samples, 1 over the squared length.
// x, y: place of the block's first sample.
__kernel void brush_cover(
    __global float *squared,
    __global const long *start,
    __global const float *along,
    const int segment,
    const int segments,
    const long x,
    const long y,
    const long fine,
    const int first,
    const int stride,
    const int rows,
    const int cols)
{
    BRUSH_EACH(row, col)
    {
        const int i = first + row * stride + col;
        float nearest = squared[i];
        for (int k = segment; k < segment + segments; ++k) {
            const float dx = (float)(x + col * fine - start[2 * k]) * BRUSH_PART;
            const float dy = (float)(y - row * fine - start[2 * k + 1]) * BRUSH_PART;
            const float ex = along[3 * k];
            const float ey = along[3 * k + 1];
            const float t = brush_within((dx * ex + dy * ey) * along[3 * k + 2]);
            const float qx = dx - t * ex;
            const float qy = dy - t * ey;
            const float d = qx * qx + qy * qy;
            nearest = d < nearest ? d : nearest;
        }
        squared[i] = nearest;
    }
}

// Replace squared distances by weights: 1 up to inner, falling smoothly to 0.
__kernel void brush_weigh(
    __global float *squared,
    const float inner,
    const float falloff,
    const int rows,
    const int cols)
{
    BRUSH_EACH(row, col)
    {
        const int i = row * cols + col;
        const float t = brush_within((sqrt(squared[i]) - inner) * falloff);
        squared[i] = 1.0f - t * t * (3.0f - 2.0f * t);
    }
}

__kernel void brush_lift(
    __global float *height,
    __global const float *weight,
    const float amount,
    const int first,
    const int stride,
    const int rows,
    const int cols)
{
    BRUSH_EACH(row, col)
    {
        const int i = first + row * stride + col;
        height[i] = height[i] + amount * weight[row * cols + col];
    }
}

__kernel void brush_level(
    __global float *height,
    __global const float *weight,
    const float share,
    const float target,
    const int first,
    const int stride,
    const int rows,
    const int cols)
{
    BRUSH_EACH(row, col)
    {
        const int i = first + row * stride + col;
        const float a = weight[row * cols + col] * share;
        height[i] = height[i] * (1.0f - a) + target * a;
    }
}

// Copy one height, so that the host need not fetch the whole terrain for it.
__kernel void brush_probe(__global const float *height, __global float *result, const int i)
{
    if (get_global_id(0) == 0) result[0] = height[i];
}

// Take the window's heights above a base, which float32 holds more finely.
__kernel void brush_take(
    __global const float *height,
    __global float *taken,
    const float base,
    const int first,
    const int stride,
    const int rows,
    const int cols)
{
    BRUSH_EACH(row, col)
    {
        taken[row * cols + col] = height[first + row * stride + col] - base;
    }
}

// Put them back where the brush was.
__kernel void brush_put(
    __global float *height,
    __global const float *taken,
    __global const float *weight,
    const float base,
    const int first,
    const int stride,
    const int rows,
    const int cols)
{
    BRUSH_EACH(row, col)
    {
        const int i = first + row * stride + col;
        const int j = row * cols + col;
        height[i] = weight[j] > 0.0f ? taken[j] + base : height[i];
    }
}

// One stage of masked diffusion: result = of_now now + of_before before + of_flow flow.
// before is overwritten with the result: every item reads and writes its own sample of it.
__kernel void brush_smooth(
    __global const float *now,
    __global float *before,
    __global const float *weight,
    const float of_now,
    const float of_before,
    const float of_flow,
    const int rows,
    const int cols)
{
    BRUSH_EACH(row, col)
    {
        const int i = row * cols + col;
        const int n = row > 0 ? i - cols : i;
        const int s = row < rows - 1 ? i + cols : i;
        const int w = col > 0 ? i - 1 : i;
        const int e = col < cols - 1 ? i + 1 : i;
        const float z = now[i];
        const float here = weight[i];
        const float cn = brush_conductance(here, weight[n]);
        const float cs = brush_conductance(here, weight[s]);
        const float cw = brush_conductance(here, weight[w]);
        const float ce = brush_conductance(here, weight[e]);
        const float along = cs * (now[s] - z) - cn * (z - now[n]);
        const float across = ce * (now[e] - z) - cw * (z - now[w]);
        before[i] = of_now * z + of_before * before[i] + of_flow * (along + across);
    }
}
