"""Through which modules a protocol passes from the command line to the recording.

    python tests/habits/way_of_a_protocol.py [PROTOCOL] [--list]

Runs `mckibben run` and looks at every function of the package that is called: it counts those that are handed a
`Protocol`, as an argument or as a field of one, and the modules that they stand in.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections import Counter
from pathlib import Path
from types import FrameType


def holds(value: object, kind: type) -> bool:
    """Whether a value is of a kind, or has one in a field of its own."""
    if isinstance(value, kind):
        return True
    fields = getattr(value, "__dict__", None)
    return isinstance(fields, dict) and any(isinstance(v, kind) for v in list(fields.values()))


def passed(words: list[str]) -> Counter[tuple[str, str]]:
    """Calls by (module, function) that were handed a protocol while a command ran."""
    import mckibben
    from mckibben.cli import main
    from mckibben.experiments.protocol import Protocol

    home, calls = os.path.dirname(mckibben.__file__) + os.sep, Counter[tuple[str, str]]()

    def look(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event != "call" or not code.co_filename.startswith(home):
            return
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        if any(holds(frame.f_locals.get(name), Protocol) for name in names):
            calls[code.co_filename.removeprefix(home), code.co_qualname] += 1

    sys.argv = ["mckibben", *words]
    sys.setprofile(look)
    try:
        main()
    except SystemExit as end:
        if end.code:
            raise
    finally:
        sys.setprofile(None)
    return calls


def run() -> None:
    """Print the count, and with `--list` each module with its functions."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("protocol", nargs="?", default="work-loop")
    parser.add_argument("--list", action="store_true", help="print each module with its functions")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "recording.nc")
        calls = passed(["run", options.protocol, "--muscle", "nylon", "--out", str(out)])
    modules: dict[str, list[str]] = {}
    for module, function in calls:
        modules.setdefault(module, []).append(function)
    print(f"{len(modules)} modules and {len(calls)} functions are handed the protocol {options.protocol}")
    for module, functions in sorted(modules.items()) if options.list else ():
        print(f"  {module}: {', '.join(functions)}")


if __name__ == "__main__":
    run()
