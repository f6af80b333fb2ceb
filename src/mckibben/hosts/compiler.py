"""The C compiler of this machine, for hosts that need a part as a library."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

from ..errors import EngineError

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")  # no contraction: the same bits on every processor


def compiler() -> list[str]:
    """Command of the compiler: that of the variable CC, else cc, gcc or clang.

    Raises:
        EngineError: there is none.
    """
    if stated := os.environ.get("CC"):
        return shlex.split(stated)
    for name in ("cc", "gcc", "clang"):
        if path := shutil.which(name):
            return [path]
    raise EngineError("No C compiler found: install gcc or clang, or name one in the environment variable CC.")


def compiler_version() -> str:
    """Name and version of the compiler, the first line that it prints of itself."""
    done = subprocess.run([*compiler(), "--version"], capture_output=True, text=True, check=False)
    return done.stdout.splitlines()[0] if done.stdout else compiler()[0]


def build_library(
    sources: Iterable[Path], library: Path, *, include: Iterable[Path] = (), link: Iterable[str] = ()
) -> Path:
    """Compile C sources to a shared library, with the flags of the variable CFLAGS behind those of the package.

    Args:
        sources: the sources.
        library: path of the library; replaced as a whole.
        include: folders of headers.
        link: further arguments of the linker.

    Returns:
        The library.

    Raises:
        EngineError: no compiler, or the first error that it reports.
    """
    made = library.with_name(f"{library.name}.{os.getpid()}.new")
    words = [
        *compiler(),
        *FLAGS,
        *shlex.split(os.environ.get("CFLAGS", "")),
        *(f"-I{folder}" for folder in include),
        *map(str, sources),
        "-o",
        str(made),
        *link,
        "-lm",
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        errors = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines()
        raise EngineError(f"The C compiler failed on {library.name}: {errors[0] if errors else 'no message'}.")
    os.replace(made, library)
    return library
