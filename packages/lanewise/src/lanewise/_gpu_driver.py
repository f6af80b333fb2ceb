"""NVIDIA's driver by its C interface: devices, memory, modules and launches, without further packages."""

from __future__ import annotations

import ctypes
import functools
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import POINTER, byref, c_char_p, c_float, c_int, c_size_t, c_uint, c_uint64, c_void_p
from typing import Any, NamedTuple

import numpy as np

from .errors import DriverError, UnavailableError

VARIABLE = "LANEWISE_GPU_DRIVER"  # a library to load in the place of the driver's
NAMES = {"win32": ("nvcuda.dll",)}.get(sys.platform, ("libcuda.so.1", "libcuda.so"))
MAJOR, MINOR = 75, 76  # attributes of a device
LOG, LOG_SIZE = 5, 6  # options of loading: where errors are written, and how much of them
SPACE = 8192  # for them
CALLS: dict[str, Sequence[Any]] = {
    "cuInit": (c_uint,),
    "cuGetErrorString": (c_int, POINTER(c_char_p)),
    "cuDeviceGetCount": (POINTER(c_int),),
    "cuDeviceGet": (POINTER(c_int), c_int),
    "cuDeviceGetName": (c_char_p, c_int, c_int),
    "cuDeviceGetAttribute": (POINTER(c_int), c_int, c_int),
    "cuDevicePrimaryCtxRetain": (POINTER(c_void_p), c_int),
    "cuCtxSetCurrent": (c_void_p,),
    "cuModuleLoadDataEx": (POINTER(c_void_p), c_char_p, c_uint, POINTER(c_int), POINTER(c_void_p)),
    "cuModuleGetFunction": (POINTER(c_void_p), c_void_p, c_char_p),
    "cuMemGetInfo_v2": (POINTER(c_size_t), POINTER(c_size_t)),
    "cuMemAlloc_v2": (POINTER(c_uint64), c_size_t),
    "cuMemFree_v2": (c_uint64,),
    "cuMemcpyHtoD_v2": (c_uint64, c_void_p, c_size_t),
    "cuMemcpyDtoH_v2": (c_void_p, c_uint64, c_size_t),
    "cuLaunchKernel": (c_void_p, *(c_uint,) * 7, c_void_p, POINTER(c_void_p), POINTER(c_void_p)),
    "cuEventCreate": (POINTER(c_void_p), c_uint),
    "cuEventRecord": (c_void_p, c_void_p),
    "cuEventSynchronize": (c_void_p,),
    "cuEventElapsedTime": (POINTER(c_float), c_void_p, c_void_p),
    "cuEventDestroy_v2": (c_void_p,),
}


class Device(NamedTuple):
    """A GPU: its number, name, and compute capability."""

    number: int
    name: str
    capability: tuple[int, int]


@functools.cache
def _library(name: str | None) -> Any:
    """The driver, ready for use."""
    for candidate in (name,) if name else NAMES:
        try:
            library = ctypes.CDLL(candidate)
        except OSError:
            continue
        for call, types in CALLS.items():
            function = getattr(library, call, None)
            if function is None:
                raise UnavailableError(
                    f"No GPU: the driver {candidate} has no {call}; one of CUDA 11 or later is needed."
                )
            function.argtypes, function.restype = types, c_int
        if (code := library.cuInit(0)) != 0:
            raise UnavailableError(f"No GPU: the driver says {_error_text(library, code)!r}.")
        return library
    raise UnavailableError(f"No GPU: no NVIDIA driver was found ({', '.join((name,) if name else NAMES)}).")


def _error_text(library: Any, code: int) -> str:
    text = c_char_p()
    library.cuGetErrorString(code, byref(text))
    return text.value.decode() if text.value else f"error {code}"


def call(name: str, *values: object) -> None:
    """Call a function of the driver.

    Raises:
        UnavailableError: if there is no driver, or it finds no GPU.
        DriverError: if the call fails; says why in the driver's words.
    """
    library = _library(os.environ.get(VARIABLE) or None)
    code = getattr(library, name)(*values)
    if code != 0:
        raise DriverError(f"The GPU's driver refused {name}: {_error_text(library, code)}.")


def devices() -> list[Device]:
    """List all GPUs of this machine.

    Raises:
        UnavailableError: if there is no driver, or it finds none; says which in one line.
    """
    count, number, major, minor = c_int(), c_int(), c_int(), c_int()
    call("cuDeviceGetCount", byref(count))
    gpus = []
    for k in range(count.value):
        call("cuDeviceGet", byref(number), k)
        text = ctypes.create_string_buffer(256)
        call("cuDeviceGetName", text, len(text), number.value)
        call("cuDeviceGetAttribute", byref(major), MAJOR, number.value)
        call("cuDeviceGetAttribute", byref(minor), MINOR, number.value)
        gpus.append(Device(number.value, text.value.decode(errors="replace"), (major.value, minor.value)))
    if not gpus:
        raise UnavailableError("No GPU: the driver is there, but it finds no device.")
    return gpus


@functools.cache
def _context(name: str | None, number: int) -> c_void_p:
    context = c_void_p()
    call("cuDevicePrimaryCtxRetain", byref(context), number)
    return context


def use_device(device: Device) -> None:
    """Make this thread's calls those of a device; its context is the one that other libraries use as well."""
    call("cuCtxSetCurrent", _context(os.environ.get(VARIABLE), device.number))


def load_ptx(text: str, entry: str) -> c_void_p:
    """A function of PTX, compiled by the driver (which keeps what it compiled) for the device in use."""
    log = ctypes.create_string_buffer(SPACE)
    options = (c_int * 2)(LOG, LOG_SIZE)
    values = (c_void_p * 2)(ctypes.addressof(log), SPACE)
    module, function = c_void_p(), c_void_p()
    try:
        call("cuModuleLoadDataEx", byref(module), text.encode(), 2, options, values)
    except DriverError as error:
        words = " ".join(log.value.decode(errors="replace").split())
        raise DriverError(f"{error} {words}".strip()) from None
    call("cuModuleGetFunction", byref(function), module, entry.encode())
    return function


def free_memory() -> int:
    """Bytes of memory that the device in use has left."""
    free, total = c_size_t(), c_size_t()
    call("cuMemGetInfo_v2", byref(free), byref(total))
    return free.value


@contextmanager
def allocate(size: int) -> Iterator[int]:
    """Bytes of the device's memory, given back at the end: their address, at a multiple of 256."""
    address = c_uint64()
    call("cuMemAlloc_v2", byref(address), max(size, 1))
    try:
        yield address.value
    finally:
        call("cuMemFree_v2", address)


def copy_to_device(address: int, array: np.ndarray) -> None:
    """Copy a contiguous NumPy array to the device."""
    if array.nbytes:
        call("cuMemcpyHtoD_v2", address, array.ctypes.data, array.nbytes)


def copy_from_device(array: np.ndarray, address: int) -> None:
    """Copy from the device into a contiguous NumPy array, after all that was launched before."""
    if array.nbytes:
        call("cuMemcpyDtoH_v2", array.ctypes.data, address, array.nbytes)


def launch(function: c_void_p, blocks: int, threads: int, *values: int) -> float:
    """Run a function with 64-bit arguments and wait for it; returns the seconds that the device took."""
    held = [c_uint64(v) for v in values]
    pointers = (c_void_p * len(held))(*map(ctypes.addressof, held))
    begin, end = c_void_p(), c_void_p()
    call("cuEventCreate", byref(begin), 0)
    call("cuEventCreate", byref(end), 0)
    try:
        call("cuEventRecord", begin, None)
        call("cuLaunchKernel", function, blocks, 1, 1, threads, 1, 1, 0, None, pointers, None)
        call("cuEventRecord", end, None)
        call("cuEventSynchronize", end)
        took = c_float()
        call("cuEventElapsedTime", byref(took), begin, end)
    finally:
        call("cuEventDestroy_v2", begin)
        call("cuEventDestroy_v2", end)
    return took.value * 1e-3
