"""The command line: it parses options with units, calls the functions of the package, and prints.

Every command that ends by itself takes ``--json`` and then prints exactly one JSON object. Exit codes: 0 done, 1 a
comparison fell short, 2 the user's input is wrong (one line on standard error).
"""

import os
import signal
import threading

from .._lazy import LazyModule

__all__ = ["main"]

_app = LazyModule(f"{__name__}.app")  # loading it takes a tenth of a second, in which Ctrl-C ends the program too


def main(arguments: list[str] | None = None) -> None:
    """Run the command line, see `app.main`; Ctrl-C ends it from its first moment, without a traceback."""
    usual = signal.getsignal(signal.SIGINT)
    alone = usual is signal.default_int_handler and threading.current_thread() is threading.main_thread()
    if alone:
        signal.signal(signal.SIGINT, _leave)
    try:
        run = _app.main
    finally:
        if alone:
            signal.signal(signal.SIGINT, usual)
    try:
        run(arguments)
    except KeyboardInterrupt:  # between two handlers
        _leave()


def _leave(*_: object) -> None:
    """End the process, which has done nothing yet."""
    os.write(2, b"mckibben: interrupted; nothing was written\n")
    os._exit(130)
