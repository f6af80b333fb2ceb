"""Emitted C, compiled for this processor and called with arrays: what the tests of `emit_c` share."""

import ctypes
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lanewise import Program, to_c
from lanewise._c import Group, make_groups

COMPILER = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2", "-ffp-contract=off", "-fPIC", "-shared"]
TYPES: dict[tuple[str, str], Any] = {
    ("real", "float64"): ctypes.c_double, ("real", "float32"): ctypes.c_float,
    ("int", "float64"): ctypes.c_int64, ("int", "float32"): ctypes.c_int64,
    ("bool", "float64"): ctypes.c_ubyte, ("bool", "float32"): ctypes.c_ubyte,
}  # fmt: skip


def built(folder: Path, sources: Mapping[str, str], name: str, flags: Sequence[str] = ()) -> Any:
    """The function of two files in a library of their own."""
    assert COMPILER
    for file, text in sources.items():
        (folder / file).write_text(text, encoding="utf-8")
    library = folder / f"{name}.so"
    done = subprocess.run(
        [COMPILER, *FLAGS, *flags, str(folder / f"{name}.c"), "-o", str(library), "-lm"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(library))


class InC:
    """A program as a library of compiled C."""

    def __init__(
        self, folder: Path, program: Program, name: str = "emitted", *, mode: str = "default", real: str = "float64",
        flags: Sequence[str] = (), **names: Any,
    ) -> None:  # fmt: skip
        self.program, self.real, self.name = program, real, name
        self.sources = to_c(program, name, mode=mode, real=real, **names)
        self.library = built(folder, self.sources, name, flags)
        self.groups = make_groups(program, name, names.get("arguments"), names.get("results"))
        self.structs = {g.name: self._struct(g) for g in self.groups}

    def _struct(self, group: Group) -> Any:
        fields = [(m.name, TYPES[m.kind, self.real] * int(np.prod(m.shape))) for m in group.members]
        return type(group.name, (ctypes.Structure,), {"_fields_": fields})

    def __call__(self, values: Sequence[Any]) -> list[Any]:
        """Results in the order of the program's, None for one that carries nothing."""
        memory = {name: struct() for name, struct in self.structs.items()}
        for group in self.groups:
            for member in group.members:
                if member.argument is not None:
                    field = np.ctypeslib.as_array(getattr(memory[group.name], member.name))
                    field[...] = np.asarray(values[member.argument]).ravel()
        scratch = np.zeros(1 << 16)  # the tests' programs need less
        getattr(self.library, self.name)(*map(ctypes.byref, memory.values()), ctypes.c_void_p(scratch.ctypes.data))
        found: list[Any] = [None] * len(self.program.results)
        for group in self.groups:
            for member in group.members:
                if member.result is not None:
                    field = np.ctypeslib.as_array(getattr(memory[group.name], member.name)).copy()
                    found[member.result] = field.reshape(member.shape)
        return found


def same_bits(a: Sequence[Any], b: Sequence[Any]) -> bool:
    """Whether two lists of results are equal to the last bit, NaN being equal to NaN."""
    return all(
        (x is None and y is None) or np.array_equal(x, y, equal_nan=x.dtype.kind == "f")
        for x, y in zip(a, b, strict=True)
    )
