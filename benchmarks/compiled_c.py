"""The hand-written C kernels: compiled for this processor, called through ctypes."""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

SOURCES = Path(__file__).parent / "kernels"
FLAGS = ("-O2", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC")


def compiler() -> str | None:
    """A C compiler that knows vectors, or None."""
    return next(
        (found for name in (os.environ.get("CC"), "gcc", "clang") if name and (found := shutil.which(name))), None
    )


def built(source: str, *options: str, cxx: bool = False) -> Path:
    """A shared library of a source in `kernels/`, compiled once per text and options."""
    cc = compiler()
    if cc is None:
        raise RuntimeError("no C compiler: install gcc or clang, or say which in CC")
    flags = (("-x", "c++") if cxx else ("-std=gnu11",)) + FLAGS + options
    text = "".join(p.read_text() for p in sorted(SOURCES.iterdir())) + source + repr(flags) + cc
    folder = Path(tempfile.gettempdir()) / f"mckibben-kernels-{os.getuid() if hasattr(os, 'getuid') else 0}"
    folder.mkdir(exist_ok=True)
    out = folder / f"{source.removesuffix('.c')}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.so"
    if not out.exists():
        part = out.with_suffix(f".{os.getpid()}")
        subprocess.run([cc, *flags, str(SOURCES / source), "-o", str(part), "-lm"], check=True)
        part.rename(out)
    return out


class Kernel:
    """A kernel of one system: float64 or float32, muscles in the lanes or one muscle."""

    def __init__(
        self, name: str, *, dtype: Any = np.float64, single: bool = False, options: tuple[str, ...] = ()
    ) -> None:
        chosen = [] if np.dtype(dtype) == np.float64 else ["-DSINGLE"]
        chosen += ["-DLANES=1"] if single else ["-DPAIR"]
        self.name, self.dtype = name, np.dtype(dtype)
        self.library = ctypes.CDLL(str(built(f"{name}.c", *chosen, *options, cxx=not single)))
        self.library.parameter_names.restype = ctypes.c_char_p
        self.parameter_names = self.library.parameter_names().decode().split()
        self.lanes_at_once = int(self.library.lanes_at_once())
        self.march = self.library.march
        pointer = ctypes.c_void_p
        self.march.argtypes = [ctypes.c_long] * 3 + [ctypes.c_double] + [pointer] * 5
        self.march.restype = None

    def prepared(self, batch: Any, inner: int, period: float) -> Run:
        """A batch laid out for the kernel, ready to be run again and again."""
        n = -(-batch.lanes // self.lanes_at_once) * self.lanes_at_once

        def pad(x: np.ndarray) -> np.ndarray:
            more = np.repeat(x[..., -1:], n - batch.lanes, axis=-1)
            return np.ascontiguousarray(np.concatenate([x, more], axis=-1), dtype=self.dtype)

        rows = batch.samples + 1 if batch.case.straight else batch.samples
        return Run(self, batch, n, inner, period, pad(batch.parameters(self.parameter_names)),
                   pad(batch.commands[:rows]), pad(batch.state()))  # fmt: skip


class Run:
    """One batch in the kernel's arrays."""

    def __init__(self, kernel: Kernel, batch: Any, n: int, inner: int, period: float, parameters: Any, commands: Any,
                 state: Any) -> None:  # fmt: skip
        self.kernel, self.lanes, self.samples, self.inner = kernel, batch.lanes, batch.samples, inner
        self.start, self.state = state, state.copy()
        self.first, self.second = (np.zeros((self.samples + 1, n), kernel.dtype) for _ in range(2))
        self._kept = parameters, commands
        arrays = (parameters, commands, self.state, self.first, self.second)
        self._call = (n, self.samples, inner, period / inner, *(a.ctypes.data for a in arrays))

    def __call__(self) -> tuple[np.ndarray, np.ndarray]:
        """The two outputs, (samples + 1, lanes)."""
        self.state[:] = self.start
        self.kernel.march(*self._call)
        return self.first[:, : self.lanes], self.second[:, : self.lanes]


def operations(name: str, batch: Any, step: float) -> int:
    """Algebraic operations of one step of one lane, counted by the kernel's own text in C++."""
    counting = ctypes.CDLL(str(built(f"{name}.c", "-DCOUNT", cxx=True)))
    counting.operations.restype = ctypes.c_long
    pointer = ctypes.c_void_p
    counting.operations.argtypes = [ctypes.c_double] + [pointer] * 3
    names = Kernel(name, single=True).parameter_names
    arrays = [
        np.ascontiguousarray(x) for x in (batch.state()[:, 0], batch.parameters(names)[:, 0], batch.commands[:2, :, 0])
    ]
    return int(counting.operations(step, *(a.ctypes.data for a in arrays)))
