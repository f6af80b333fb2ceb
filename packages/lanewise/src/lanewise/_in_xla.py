"""Kernels of one run as calls of XLA's own: no Python between two samples of a scan.

XLA hands a foreign function a frame with the places of its arguments and results; a few lines of machine code lay them in
the order of the kernel. Offsets in the frame are those of the C interface of XLA, ``xla/ffi/api/c_api.h``, version 0. The
name by which XLA finds a call is that of its content, since compiled programs may be kept on disk.
"""

from __future__ import annotations

import ctypes
import functools
import re
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from ._kernel import Kernel, LoadedCode, cache_key, llvm, load_object, target_machine
from ._program import Leaf, Program

LARGEST = 1 << 18  # bytes of a stack that a call may take
# Offsets: extension, arguments and results in a frame, data in a buffer; type and metadata in an extension; version there.
EXTENSION, ARGUMENTS, RESULTS, DATA, KIND, METADATA, MAJOR, MINOR = 8, 72, 112, 24, 8, 24, 24, 28
BEGINNING = f"""define ptr @kernel(ptr %frame) {{
%e = getelementptr i8, ptr %frame, i64 {EXTENSION}
%extension = load ptr, ptr %e
%plain = icmp eq ptr %extension, null
br i1 %plain, label %run, label %more
more:
%k = getelementptr i8, ptr %extension, i64 {KIND}
%kind = load i32, ptr %k
%asks = icmp eq i32 %kind, 1
br i1 %asks, label %tell, label %run
tell:
%m = getelementptr i8, ptr %extension, i64 {METADATA}
%metadata = load ptr, ptr %m
%major = getelementptr i8, ptr %metadata, i64 {MAJOR}
store i32 0, ptr %major
%minor = getelementptr i8, ptr %metadata, i64 {MINOR}
store i32 MINOR_VERSION, ptr %minor
ret ptr null
run:"""
_registering = threading.Lock()
_registered: dict[str, tuple[LoadedCode, Kernel]] = {}  # XLA goes on to call what it once was told


def foreign_call(program: Program, mode: str, begin: int, shapes: Sequence[Any], arrays: Sequence[Any]) -> Any:
    """Call a program in XLA, on one run.

    Args:
        program: program to call.
        mode: mode of its kernel.
        begin: first result that is wanted.
        shapes: shapes and types of the wanted results.
        arrays: arguments, of which each has the elements of one run.

    Returns:
        The wanted results; None where the memory of the kernel is too large for a stack, or XLA has another interface.
    """
    if _minor_version() is None:
        return None
    kernel = program.kernel(frozenset(), lanes=False, mode=mode, real="float64")
    places = [k for k, leaf in enumerate(program.results) if leaf.kind is not None and k >= begin]
    hidden = [s for s in kernel.slots if s.role == "result" and s.place not in places]
    if kernel.scratch + 64 + sum(map(_bytes, (s.shape for s in hidden))) > LARGEST:
        return None
    name = "lanewise_" + cache_key(program.serialised, mode, begin)
    with _registering:  # a name that is registered again is refused
        if name not in _registered:
            code = _frame_reader(kernel, places)
            jax.ffi.register_ffi_target(name, _capsule()(code.address, None, None), platform="cpu")
            _registered[name] = code, kernel
    leaves: Sequence[Leaf] = program.arguments
    return jax.ffi.ffi_call(name, shapes)(*(x.reshape(leaf.shape) for x, leaf in zip(arrays, leaves, strict=True)))


@functools.cache
def _minor_version() -> int | None:
    """Minor version of XLA's interface, whose major one is 0."""
    header = Path(jax.ffi.include_dir()) / "xla/ffi/api/c_api.h"
    text = header.read_text(encoding="utf-8") if header.is_file() else ""
    version = [re.search(rf"#define XLA_FFI_API_{part} (\d+)", text) for part in ("MAJOR", "MINOR")]
    return int(version[1][1]) if version[0] and version[1] and version[0][1] == "0" else None


@functools.cache
def _capsule() -> Any:
    make = ctypes.pythonapi.PyCapsule_New
    make.restype, make.argtypes = ctypes.py_object, (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    return make


def _bytes(shape: tuple[int, ...]) -> int:
    """Room for an array on the stack."""
    return 8 * int(np.prod(shape)) + 64


def _frame_reader(kernel: Kernel, places: Sequence[int]) -> LoadedCode:
    """Machine code that calls a kernel with what a frame of XLA holds."""
    count, lines = len(kernel.slots), []
    for k, slot in enumerate(kernel.slots):
        if slot.role == "result" and slot.place not in places:
            lines.append(f"%p{k} = alloca [{_bytes(slot.shape)} x i8], align 64")
        else:
            table, place = (
                ("arguments", slot.place) if slot.role == "argument" else ("results", places.index(slot.place))
            )
            lines += [
                f"%a{k} = getelementptr ptr, ptr %{table}, i64 {place}",
                f"%b{k} = load ptr, ptr %a{k}",
                f"%d{k} = getelementptr i8, ptr %b{k}, i64 {DATA}",
                f"%p{k} = load ptr, ptr %d{k}",
            ]
        lines += [f"%q{k} = getelementptr ptr, ptr %all, i64 {k}", f"store ptr %p{k}, ptr %q{k}"]
    for name, offset in (("arguments", ARGUMENTS), ("results", RESULTS)):
        lines[:0] = [f"%o{name} = getelementptr i8, ptr %frame, i64 {offset}", f"%{name} = load ptr, ptr %o{name}"]
    text = [
        BEGINNING.replace("MINOR_VERSION", str(_minor_version())),
        f"%all = alloca [{count + 1} x ptr]",
        f"%scratch = alloca [{kernel.scratch + 64} x i8], align 64",
        *lines,
        f"%last = getelementptr ptr, ptr %all, i64 {count}",
        "store ptr %scratch, ptr %last",
        f"%code = inttoptr i64 {kernel.code.address} to ptr",
        "call void %code(ptr %all, i64 1, i64 0, i64 1)",
        "ret ptr null",
        "}",
    ]
    return load_object(target_machine().emit_object(llvm().parse_assembly("\n".join(text))))
