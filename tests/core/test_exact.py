"""Exact math: small errors, and the same bits in NumPy and OpenCL."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Run
from terrakit.compute import Device, choose_device, exact

F = np.float32
KERNEL = """
__kernel void probe_all(__global const float *x, __global const uint *u,
    __global float *logs, __global float *exps, __global float *powers, __global uint *hashes,
    const float exponent, const int n)
{
    const int i = (int)get_global_id(0);
    if (i >= n) return;
    logs[i] = exact_log2(x[i]);
    exps[i] = exact_exp2(exact_log2(x[i]));
    powers[i] = exact_power(x[i], exponent);
    hashes[i] = exact_hash(u[i], 5u, (int)u[i], -3);
}
"""


@pytest.fixture(scope="module")
def values() -> np.ndarray:
    random = np.random.default_rng(4)
    spread = np.exp2(random.uniform(-125, 127, 20000)).astype(F)
    near = (1 + random.uniform(-0.3, 0.3, 20000)).astype(F)
    special = np.array([1, 2, 0.5, 1.41421356, 1.17549435e-38, 3.4e38], dtype=F)
    return np.concatenate((spread, near, special))


def test_logarithm_and_exponential_are_accurate(values: np.ndarray) -> None:
    true = np.log2(values.astype(np.float64))
    error = np.abs(exact.log2(values) - true)
    assert (error <= 2e-7 + np.abs(true) * 2.0**-23).all()
    exponents = np.linspace(-125.9, 126.9, 30001).astype(F)
    relative = np.abs(exact.exp2(exponents) / np.exp2(exponents.astype(np.float64)) - 1)
    assert relative.max() < 3e-7


def test_powers_are_accurate() -> None:
    base = np.linspace(0.0, 3000.0, 4001).astype(F)
    for exponent in (0.45, 0.5, 1.0, 2.3, -0.85):
        with np.errstate(divide="ignore"):
            true = base.astype(np.float64) ** exponent
        relative = np.abs(exact.power(base[1:], exponent) / true[1:] - 1)
        assert relative.max() < 1e-5
    assert exact.power(np.zeros(2, F), 0.5).tolist() == [0.0, 0.0]
    assert exact.power(np.zeros(2, F), 0.0).tolist() == [1.0, 1.0]


def test_exponential_saturates() -> None:
    far = exact.exp2(np.array([-1000.0, -127.0, 1000.0, 0.0], dtype=F))
    assert far.tolist() == [0.0, 0.0, 2.0**127, 1.0]


def test_hash_has_no_order() -> None:
    i, j = np.meshgrid(np.arange(256), np.arange(256))
    hashes = exact.hashed((1, 2), i.ravel(), j.ravel())
    assert len(np.unique(hashes)) > 0.999 * hashes.size
    bits = (hashes[:, None] >> np.arange(32, dtype=np.uint32)) & 1
    assert np.abs(bits.mean(axis=0) - 0.5).max() < 0.01
    uniform = exact.uniform(hashes)
    assert 0 <= uniform.min() < uniform.max() < 1
    assert abs(uniform.mean() - 0.5) < 0.005


def test_opencl_gives_the_same_bits(values: np.ndarray) -> None:
    if not choose_device().is_opencl:
        pytest.skip("no OpenCL device")
    device = Run().device
    assert isinstance(device, Device)
    count, exponent = len(values), 0.45
    words = np.random.default_rng(1).integers(0, 2**32, count, dtype=np.uint32)
    out = [device.empty(count) for _ in range(3)]
    hashes = device.empty(count, np.uint32)
    device.program_from_source("probe", KERNEL).launch(
        "probe_all",
        count,
        device.upload(values),
        device.upload(words),
        *out,
        hashes,
        F(exponent),
        np.int32(count),
    )
    logs = exact.log2(values)
    expected = (logs, exact.exp2(logs), exact.power(values, exponent))
    for array, twin in zip(out, expected, strict=True):
        assert array.download().tobytes() == twin.astype(F).tobytes()
    minus_three = np.uint32(2**32 - 3)
    twin_hash = exact.mix(exact.mix(exact.mix(words ^ words) + minus_three) ^ np.uint32(5))
    assert hashes.download().tobytes() == twin_hash.tobytes()


def test_source_that_does_not_build_is_named() -> None:
    from terrakit import KernelError

    device = Run().device
    if device is None:
        pytest.skip("no OpenCL device")
    with pytest.raises(KernelError, match=r"broken\.cl.*2") as caught:
        device.program_from_source("broken.cl", "__kernel void f() {\n  nonsense;\n}")
    assert "\n" not in str(caught.value)
