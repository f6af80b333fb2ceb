"""Manual operation in a loop of its own, which never ends by itself: it holds, it follows, and stopped it stays vented.

It is compiled once. Where a protocol runs, its thread ends between two samples, and begins again at the sample after the
run's last one, with what the run's controllers and set-points were.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from ...errors import LineLostError
from ..hardware.ongoing import carried
from ..software.manual import ROW
from ..software.sequencer import SPAN, TENSION
from ..wall_clock import Lateness, Loop

SHOWN = 20000  # samples whose lateness is remembered
MODES = ("command.span", "command.velocity", "command.tension")  # in the order of the motor's modes


class Wishes:
    """What is asked for, as the loop reads it at every sample: numbers in the order of `manual.ROW`.

    Pressure [Pa], open 1 or 0, the motor's mode and its value [m, m/s or N; NaN: stay], alone 1 or 0.
    """

    names = ROW

    def __init__(self) -> None:
        self._now = np.zeros(len(ROW))
        self.change(motor=np.nan, open=1.0)

    def __call__(self) -> np.ndarray:
        """Those of now."""
        return self._now

    def change(self, **values: float) -> None:
        """Ask for something else; all of it counts from the same sample on."""
        new = np.array(self._now)
        for name, value in values.items():
            new[ROW.index(name)] = value
        self._now = new

    def __getitem__(self, name: str) -> float:
        """One of them."""
        return float(self._now[ROW.index(name)])


class Gate:
    """Lets a loop go on to a sample and then wait: the time of a machine that only goes while somebody wants it to."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._until = self._at = 0
        self._shut = False

    def through(self, until: int) -> None:
        """Let samples below a number through, until the loop waits at that one or is sent away."""
        with self._changed:
            self._until = max(until, self._until)
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._shut or self._at >= until)

    def shut(self, closed: bool = True) -> None:
        """Send whoever waits away; or let it wait again."""
        with self._changed:
            self._shut = closed
            self._changed.notify_all()

    def passes(self, number: int) -> bool:
        """Wait for a sample's turn; False where there will be none."""
        with self._changed:
            self._at = number
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._shut or number < self._until)
            return not self._shut


class ManualLoop(Loop):
    """The loop of a session while no protocol runs; its thread is begun and ended by `go` and `leave`.

    Args:
        gate: at which every sample waits; None: by the machine's clock.
        failed_: called from its thread when it cannot go on.
        of_loop: as of `wall_clock.Loop`.
    """

    def __init__(self, *of_loop: Any, gate: Gate | None, over: Callable[[BaseException], None], **options: Any) -> None:
        super().__init__(*of_loop, longest=SHOWN, **options)
        self.gate, self._over = gate, over
        self._leaving, self._fresh = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None

    def go(self, after: Loop | None = None) -> None:
        """Begin, or go on after another loop: with its controllers, and where its set-points were."""
        if after is not None and after.state is not None and self.state is not None:
            self.state = self._following(after)
        self._leaving.clear()
        if self.gate is not None:
            self.gate.shut(False)
        self._thread = threading.Thread(target=self.run, name="bench by hand", daemon=True)
        self._thread.start()

    def leave(self) -> Loop:
        """End between two samples, and wait for that."""
        self._leaving.set()
        if self.gate is not None:
            self.gate.shut()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        return self

    @property
    def alive(self) -> bool:
        """Whether its thread is at work."""
        return self._thread is not None and self._thread.is_alive()

    def renew(self) -> None:
        """At the next sample the software begins anew, at rest where the machine is."""
        self._fresh.set()

    def run(self) -> None:
        """Samples until it is told to leave, or the machine is lost. Garbage is collected, since it may be long."""
        interval = sys.getswitchinterval()
        sys.setswitchinterval(1e-4)
        try:
            self.hardware.start(self.period)
            self._samples()
        except LineLostError as error:
            self._end(error)
        except BaseException as error:
            self._end(error)
        finally:
            sys.setswitchinterval(interval)

    def _end(self, error: BaseException) -> None:
        self.hardware.valve.vent()
        self._over(error)
        if self.gate is not None:
            self.gate.shut()

    def _samples(self) -> None:
        leaving, gate, number = self._leaving, self.gate, self._number
        while not leaving.is_set():
            if gate is not None and not gate.passes(number()):
                return
            if self._fresh.is_set():
                self._fresh.clear()
                self.state = None
            self.lateness[self.taken % SHOWN] = self._sample(self.taken)
            self.taken += 1

    def _number(self) -> int:
        return int(self.hardware.ground.number)  # type: ignore[attr-defined]

    def deadlines(self) -> Lateness:
        """Of the newest samples; all are counted."""
        found = Lateness.of(self.lateness[: min(self.taken, SHOWN)], self.period)
        return found._replace(samples=self.taken)

    def _following(self, after: Loop) -> np.ndarray:
        """The state after a protocol: its last set-points are held; a velocity is not, but the span that it led to."""
        assert self.state is not None and after.state is not None
        found = carried(after, self, self.state)
        place, (mode, value) = self.places["place"], motor_of(after)
        driven = float(after.state[after.places["driven"]])
        put = {
            place.pressure: after.number("command.pressure"), place.velocity: 0.0, place.acceleration: 0.0,
            place.mode: TENSION if mode == TENSION else SPAN, place.span: driven, place.alone: 0.0, place.step: 0.0,
            place.open: float(after.opened),
        }  # fmt: skip
        if mode == TENSION:
            put[place.tension] = value
        for index, number in put.items():
            found[index] = number
        return found


def motor_of(loop: Loop) -> tuple[int, float]:
    """Mode of the motor at a loop's newest sample, and its set-point [m, m/s or N]."""
    values = [loop.number(name) for name in MODES]
    mode = next((i for i, v in enumerate(values) if np.isfinite(v)), SPAN)
    return mode, values[mode]
