"""Try every OpenCL device in a process of its own, because a broken one takes its process along.

PoCL aborts where others raise: an unwritable or corrupted kernel cache, exhausted memory, a full
disk. :mod:`terrakit.compute.discovery` therefore runs this file as a child before the first
context of a process. It is a plain script, imports nothing of terrakit, and prints one JSON
object a line: ``{"trying": name}`` before a device is touched, the facts about it afterwards. If
it dies, the last line names the culprit.
"""

from __future__ import annotations

import json
import sys
from typing import Any

SOURCE = "__kernel void probe(__global float *a) { a[get_global_id(0)] *= 2.0f; }"


def facts(platform: Any, device: Any) -> dict[str, Any]:
    """Return what the choice of a device depends on, as JSON can hold it."""
    import pyopencl as cl

    kinds = {cl.device_type.GPU: "gpu", cl.device_type.CPU: "cpu"}
    correctly_rounded = cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
    return {
        "name": " ".join(device.name.split()),
        "platform": " ".join(platform.name.split()),
        "version": " ".join(f"{platform.version} / {device.driver_version}".split()),
        "kind": kinds.get(device.type & ~cl.device_type.DEFAULT, "accelerator"),
        "memory": int(device.global_mem_size),
        "largest_buffer": int(device.max_mem_alloc_size),
        "compute_units": int(device.max_compute_units),
        "largest_work_group": int(device.max_work_group_size),
        "correctly_rounded": bool(device.single_fp_config & correctly_rounded),
    }


def run_kernel(device: Any) -> None:
    """Build and run a kernel; raise if the answer is wrong."""
    import numpy as np
    import pyopencl as cl

    context = cl.Context([device])
    queue = cl.CommandQueue(context)
    program = cl.Program(context, SOURCE).build()
    values = np.arange(64, dtype=np.float32)
    flags = cl.mem_flags
    memory = cl.Buffer(context, flags.READ_WRITE | flags.COPY_HOST_PTR, hostbuf=values)
    kernel = cl.Kernel(program, "probe")
    kernel(queue, values.shape, None, memory)
    result = np.empty_like(values)
    cl.enqueue_copy(queue, result, memory)
    if not np.array_equal(result, values * 2):
        raise RuntimeError("the probe kernel returned wrong values")


def say(**fields: Any) -> None:
    """Print one JSON line and push it out, since the next step may end the process."""
    sys.stdout.write(json.dumps(fields) + "\n")
    sys.stdout.flush()


def main(skip: list[str]) -> None:
    """Try every device that is not in ``skip``."""
    say(trying="import pyopencl")
    import warnings

    import pyopencl as cl

    warnings.simplefilter("ignore")
    say(trying="the list of platforms")
    try:
        platforms = cl.get_platforms()
    except cl.Error as error:
        say(failed="the list of platforms", reason=str(error))
        return
    for platform in platforms:
        try:
            devices = platform.get_devices()
        except cl.Error as error:
            say(failed=platform.name, reason=str(error))
            continue
        for device in devices:
            found = facts(platform, device)
            name = f"{found['platform']}: {found['name']}"
            if name in skip:
                continue
            say(trying=name)
            try:
                run_kernel(device)
            except Exception as error:
                say(failed=name, reason=str(error).splitlines()[0])
            else:
                say(device=found)
    say(done=True)


if __name__ == "__main__":
    main(sys.argv[1:])
