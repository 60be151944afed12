"""Devices, programs and buffers; the only part of terrakit that imports pyopencl.

An operator asks its run for a device, a device for a program, and a program to launch a kernel
over an array's shape. Where there is no OpenCL device, :data:`NUMPY` stands in and every operator
runs its NumPy reference, which gives the same bytes.
"""

from __future__ import annotations

from terrakit.compute.arrays import DeviceArray
from terrakit.compute.cancellation import check_cancelled, watched
from terrakit.compute.device import Device, Program
from terrakit.compute.discovery import NUMPY, DeviceInfo, available_devices, choose_device

__all__ = [
    "NUMPY",
    "Device",
    "DeviceArray",
    "DeviceInfo",
    "Program",
    "available_devices",
    "check_cancelled",
    "choose_device",
    "watched",
]
