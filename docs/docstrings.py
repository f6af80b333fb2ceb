"""Run the examples in the docstrings of the public names.

    python docs/docstrings.py [NAME ..]     prints the time of each, and what is wrong
"""

from __future__ import annotations

import doctest
import io
import os
import shutil
import sys
import tempfile
import time
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Names whose examples simulate or compute for seconds; the page of the reference runs them, the test suite does not.
LONG = ("Session", "Simulation", "circuit", "compare", "diagnose", "prepare", "reproduce", "run", "size")


def names() -> list[str]:
    """Return the public names that have a docstring of their own."""
    import mckibben

    return [name for group in mckibben.PUBLIC.values() for name in group]


def examples(name: str) -> list[doctest.DocTest]:
    """Return the examples of a public name: of its docstring and those of its methods."""
    import mckibben

    value = getattr(mckibben, name)
    described = value if hasattr(value, "__name__") else type(value)  # `mckibben.muscle` is an object that is called
    found = doctest.DocTestFinder().find(described, name, module=False)
    return [test for test in found if test.examples]


def failures(name: str) -> str:
    """Run the examples of a public name in an empty folder with a copy of `examples/`; return what is wrong."""
    output = io.StringIO()
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        # with every answer of a muscle whose law has a large error
        warnings.filterwarnings("ignore", "the tension of .* may be off by")
        # a file torn by a process that was killed: JAX compiles anew, and the example is as right
        warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache", UserWarning)
        shutil.copytree(ROOT / "examples", Path(folder) / "examples")
        os.chdir(folder)
        try:
            tests = examples(name)
            for test in tests:
                runner.run(test, out=output.write)
        finally:
            os.chdir(before)
    if not tests:
        return f"mckibben.{name} has no example in its docstring\n"
    return output.getvalue()


if __name__ == "__main__":
    for each in sys.argv[1:] or names():
        begun = time.perf_counter()
        wrong = failures(each)
        print(f"{each:16} {time.perf_counter() - begun:5.2f} s{'  FAILED' if wrong else ''}")
        print(wrong, end="")
