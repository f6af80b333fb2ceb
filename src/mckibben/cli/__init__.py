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
    """Run the command line, see `app.main`; Ctrl-C ends it from its first moment, without a traceback.

    A request of the system to end, and the end of its terminal, do what Ctrl-C does: what it keeps, they keep.
    """
    usual = signal.getsignal(signal.SIGINT)
    # in the background of a script Ctrl-C is ignored, and the system still asks for the end
    ours = usual in (signal.default_int_handler, signal.SIG_IGN)
    alone = ours and threading.current_thread() is threading.main_thread()
    names = [n for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)] if alone else []
    before = {n: handler for n in names if (handler := signal.getsignal(getattr(signal, n))) is not signal.SIG_IGN}
    for name in before:
        signal.signal(getattr(signal, name), _leave)
    try:
        run = _app.main
    finally:
        for name in before:
            signal.signal(getattr(signal, name), usual if name == "SIGINT" else _interrupt)
    try:
        run(arguments)
    except KeyboardInterrupt:  # between two handlers
        _leave(*_signalled[-1:])
    except SystemExit as end:
        raise (SystemExit(128 + _signalled[-1]) if _signalled and end.code == 128 + signal.SIGINT else end) from None
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)
        _signalled.clear()


_signalled: list[int] = []  # requests of the system to end


def _interrupt(number: int, _: object) -> None:
    """Do at a request of the system to end what Python does at Ctrl-C."""
    _signalled.append(number)
    raise KeyboardInterrupt


def _leave(number: int = signal.SIGINT, _: object = None) -> None:
    """End the process, which has done nothing yet."""
    os.write(2, b"mckibben: interrupted; nothing was written\n")
    os._exit(128 + number)
