"""Set-points of manual mode as devices that are moved: what is requested, refused before it moves, and there when it is."""

from __future__ import annotations

import contextlib
import math
from typing import Any, Self

from ...errors import InputError, MckibbenError, UnreachableError
from ...experiments.amounts import CHANNELS
from ...quantities import with_unit
from ..session.continued import CLOSE, LONG, LOOK, NEAR
from .machine import DeviceContext, Keys
from .signals import ChannelSignal
from .status import DeviceStatus

EXACT = 1e-6  # of the allowed range, within which the machine's own set-point is the one asked for
AXES = ("pressure", "span", "velocity", "tension")
RATES = {"pressure": "pressure_rate", "span": "speed", "velocity": "acceleration", "tension": "tension_rate"}
PER = {"pressure": "Pa/s", "span": "m/s", "velocity": "m/s^2", "tension": "N/s"}


class SetPoint(ChannelSignal):
    """The pressure, or one of span, velocity and tension, which share the motor.

    It reads the machine's set-point, which goes where it is asked no faster than the manual rate; what is measured has
    signals of its own.

    Bluesky: NamedMovable, Locatable, Checkable, Stoppable, Stageable, and what `ChannelSignal` is.

    Args:
        machine: whose.
        axis: pressure, span, velocity or tension.
        settle: time at the end of a move [s].
    """

    def __init__(self, machine: DeviceContext, axis: str, *, settle: float = 0.0) -> None:
        super().__init__(machine, f"command.{axis}")
        self.axis, self.settle = axis, settle
        self.moving = "pressure" if axis == "pressure" else "motor"
        self._to: float | None = None
        self._own: DeviceStatus | None = None
        self._moved = False

    @property
    def limits(self) -> tuple[float, float]:
        """What the rig allows by hand [SI]."""
        return self.machine.session.setup.allowed(self.axis)  # noqa: SLF001

    def check_value(self, value: float | str) -> None:
        """Refuse what the rig does not allow.

        Raises:
            InputError: names what is allowed.
        """
        self.machine.session.setup.amount(self.axis, value)

    def set(self, value: float | str) -> DeviceStatus:
        """Go to a set-point, in SI or as text; done when it and what is measured are there, and the settling time over.

        Raises:
            InputError: if the rig does not allow it, or the machine is not in manual mode; then nothing moves.
        """
        session = self.machine.session
        to = session.setup.amount(self.axis, value)
        self.machine.free(self.name)
        with self.machine.lock:
            before = self.machine.moves.get(self.moving)
            session.set(**{self.axis: to})
            self._to, self._moved = to, True
            status = DeviceStatus.of(f"{self.name} to {self._worded(to)}", lambda own: self._go(to, own))
            self.machine.moves[self.moving] = self._own = status
        if before is not None and not before.done:
            before.finish(
                InputError(self.name, self._worded(to), f"it was asked for before this was there: {before.what}")
            )
        return status

    def _worded(self, value: float) -> str:
        return with_unit(value, CHANNELS[self.axis])

    def _go(self, to: float, own: DeviceStatus) -> None:
        """Wait until it is there; ends where somebody else ended the move."""
        session, range_ = self.machine.session, max(abs(end) for end in self.limits)
        near = {"span": CLOSE, "velocity": math.inf}.get(self.axis, NEAR * range_)
        left, before = LONG, math.nan
        while not own.done:
            session.wait(LOOK)
            at = session.latest()
            if session.why or session.gone:
                raise MckibbenError(f"{self.name}: on the way to {self._worded(to)}: {session.why or session.gone}")
            asked, measured = at[self.channel], at.get(self.axis, to)
            arrived = abs(asked - to) <= EXACT * range_
            if arrived and abs(measured - to) <= near:
                session.wait(self.settle)
                return
            left -= LOOK if arrived or not abs(asked - before) > 0.0 else 0.0
            if left <= 0.0:
                found = f"{self._worded(asked)} is asked for and {self._worded(measured)} measured"
                raise UnreachableError(f"{self.name}: {self._worded(to)} was not reached; {found}")
            before = asked

    def locate(self) -> dict[str, float]:
        """Where it is asked to be, and what is measured, which stands for both while something else is controlled [SI].

        A velocity is not measured, and is that of the set-point.
        """
        at = self.machine.session.latest()
        asked = at[self.channel]
        measured = at.get(self.axis, 0.0 if math.isnan(asked) else asked)
        if self._to is not None and self._own is not None and not self._own.done:
            asked = self._to
        return {"setpoint": measured if math.isnan(asked) else asked, "readback": measured}

    def stop(self, success: bool = True) -> None:
        """End a move; the RunEngine asks for it after every plan, and where it pauses, for all that the plan has moved.

        A pressure on its way is let down, a motor on its way stops where it is, and whatever is there is held.

        Args:
            success: False: something went wrong; an emergency stop.
        """
        if not success:
            self.machine.session.emergency_stop(f"{self.name} was stopped")
            self._end(MckibbenError(f"{self.name} was stopped"))
            return
        busy = self._own is not None and not self._own.done
        driven = self.axis == "velocity" and abs(self.machine.session.latest()[self.channel]) > 0.0
        self._end(None)
        if busy and self.axis == "pressure":
            self.machine.let_down(f"{self.name} was stopped")
        elif busy or driven:
            with contextlib.suppress(InputError):
                self.machine.free(self.name)
                self.machine.session.set(velocity=0.0)

    def _end(self, error: BaseException | None) -> None:
        if self._own is not None:
            self._own.finish(error)

    def stage(self) -> list[Self]:
        """A plan begins to use it."""
        self._moved = False
        return [self]

    def unstage(self) -> list[Self]:
        """The plan is over, however it ended: a pressure that it set is let down, and a velocity ends."""
        moved, self._moved = self._moved, False
        self.stop()
        if moved and self.axis == "pressure":
            self.machine.let_down("the plan that set the pressure is over")
        return [self]

    def describe(self) -> Keys:
        """As of any signal, with the limits."""
        low, high = self.limits
        return {self.name: self.machine.described(self.channel, limits={"control": {"low": low, "high": high}})}

    def _settings(self) -> tuple[dict[str, Any], dict[str, str]]:
        rate = float(getattr(self.machine.session.setup.manual, RATES[self.axis]))
        return {"rate": rate, "settle": self.settle}, {"rate": PER[self.axis], "settle": "s"}
