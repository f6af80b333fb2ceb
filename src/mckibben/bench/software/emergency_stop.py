"""Emergency stop: at the next sample the muscle is vented and the motor only brakes."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


def sentence(stop: Callable[[], bool], when: float) -> str:
    """Message describing a stop at a time [s]; a stop function without a text was requested by the user."""
    kind, done = ("stopped", "vented") if getattr(stop, "ordinary", False) else ("emergency stop", "stopped and vented")
    return f"{kind} at {when:.6g} s: {getattr(stop, 'reason', '') or 'asked to'}; {done}"


class EmergencyStop:
    """A latching stop button, for any thread or a signal of the system. Called as a function it returns its state.

    Args:
        told: given the reason, and whether it is ordinary, whenever it is pressed.

    Attributes:
        reason: reason given with the stop.
        ordinary: whether the user ended the run, without a fault; the machine does the same.
    """

    def __init__(self, listener: Callable[[str, bool], None] | None = None) -> None:
        """Create the button, not pressed."""
        self._pressed, self._told = threading.Event(), listener
        self.reason, self.ordinary = "", False

    def press(self, reason: str = "the button was pressed", *, ordinary: bool = False) -> None:
        """Press the button. The first reason stays; an ordinary stop can become an emergency."""
        if not self._pressed.is_set() or (self.ordinary and not ordinary):
            self.reason, self.ordinary = reason, ordinary
            self._pressed.set()
        if self._told is not None:
            self._told(reason, ordinary)

    def __call__(self) -> bool:
        """Return whether the button is pressed."""
        return self._pressed.is_set()

    @contextmanager
    def on_signals(self) -> Iterator[None]:
        """Press the button on Ctrl-C and on termination, within the context; a second signal ends the program.

        In a thread that is not the main one nothing is changed; nor is a hang-up that is ignored, as by `nohup`.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        names = [n for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
        names = [n for n in names if n != "SIGHUP" or signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN]
        before = {name: signal.signal(getattr(signal, name), self._signalled) for name in names}
        try:
            yield
        finally:
            for name, handler in before.items():
                signal.signal(getattr(signal, name), handler)

    def _signalled(self, number: int, _: FrameType | None) -> None:
        if self():
            raise KeyboardInterrupt
        self.press(f"signal {signal.Signals(number).name}")
