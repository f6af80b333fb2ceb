"""Preparation of manual operation: the machine, its software, and the allowed set-points."""

from __future__ import annotations

import numpy as np

from ..._jax import jnp
from ...assembly.accounts import Accounts
from ...documents import JsonValue
from ...errors import InputError
from ...experiments.amounts import CHANNELS, read_amount
from ...experiments.dry_run import check
from ...experiments.protocol import Protocol
from ...experiments.read import build_protocol
from ...quantities import with_unit
from ..hardware.clock import Clock
from ..hardware.simulated import SimulatedHardware
from ..prepare import PreparedRun, prepare_on_machine
from ..rig import Rig
from ..segment import SegmentMachine, software_of, timing_of
from ..software.loop import BenchSoftware
from ..software.manual import Manual
from ..software.sequencer import SPAN, TENSION, VELOCITY

HOLD = 5.0  # time for which set-points are held without a hand [s]
RATE = 1000.0  # samples per second, where the computer can [1/s]
MODES = {"span": SPAN, "velocity": VELOCITY, "tension": TENSION}


def session_rate(rig: Rig) -> float:
    """Return the usual sample rate of a session on a rig [1/s]."""
    return min(max(RATE, float(rig.computer.lowest_rate)), float(rig.computer.highest_rate))


def prepare_for_session(protocol: Protocol, rig: Rig, **options: object) -> PreparedRun:
    """Make the dry run of a protocol for a session that is not open yet, as `Session.prepare` will.

    Args:
        protocol: the protocol.
        rig: whose machine the session will have.
        **options: of `prepare`: muscle, unit.

    Raises:
        InputError: names what cannot be read.
    """
    manual = build_protocol(_manual_operation("1 L0", session_rate(rig)), where="session")
    return prepare_on_machine(protocol, session_rate(rig), rig=rig, plumbing=rig.layout(manual), **options)


class ManualSetup:
    """A rig with a muscle, ready to be operated by hand.

    Args:
        rig: the rig.
        span: at which the muscle is mounted, as text or [m]; the rest length by default.
        rate: samples per second [1/s].
        hold: time for which set-points are held without a hand [s].
        **options: of `prepare`: muscle, unit, plumbing, seed, step.

    Raises:
        InputError: names what is unknown, or that the machine may not even stand there.
    """

    def __init__(
        self, rig: Rig, *, span: float | str | None = None, rate: float | None = None, hold: float = HOLD,
        **options: object,
    ) -> None:  # fmt: skip
        self.rig, self.rate = rig, session_rate(rig) if rate is None else rate
        place = "1 L0" if span is None else span if isinstance(span, str) else f"{span!r} m"
        operation = build_protocol(_manual_operation(place, self.rate), where="session")
        self.prepared: PreparedRun = prepare_on_machine(operation, self.rate, rig=rig, **options)
        check(list(self.prepared.findings), where="session")
        self.options = {**options, "rig": rig, "plumbing": self.prepared.layout}  # of every run on this machine
        self.timing, (self.segment,) = timing_of(self.prepared), tuple(self.prepared.segments())
        self.limits = rig.limits(self.prepared.layout)
        self.manual = Manual.of(self.limits, hold=hold)
        self.watch = rig.watch(self.prepared.layout)
        self.converters = rig.converters(self.segment.start_span)
        self.machine = rig.machine(
            self.segment.layout, self.prepared.unit, start=self.segment.start_span, moves=self.segment.moves
        )
        self._own: SegmentMachine | None = None
        self._simulated: SimulatedHardware | None = None

    def simulated(self, clock: Clock | None) -> SimulatedHardware:
        """Set up the simulated machine, vented, with the muscle mounted."""
        self._own = SegmentMachine(self.prepared, 0, self.segment, self.timing)
        self._simulated = SimulatedHardware(self._own.at_interface(), clock)
        return self._simulated

    def software(self) -> BenchSoftware:
        """Build the software of manual operation; it begins vented, at the present span."""
        software = software_of(self.prepared, self.segment, self.timing)
        return software.replace(sequencer=self.manual, start_motor=jnp.asarray(jnp.nan))

    def amount(self, name: str, value: float | str) -> float:
        """Read a set-point, as text or SI, and check it against the limits of the rig [SI].

        Raises:
            InputError: names what is allowed.
        """
        unit = CHANNELS[name]
        si = (
            read_amount(value, unit, field=name).si(self.prepared.plan.rest_length)
            if isinstance(value, str)
            else float(value)
        )
        if name != "pressure" and self.rig.motor is None:
            raise InputError(name, with_unit(si, unit), f"the rig {self.rig.name} has no motor")
        low, high = self.allowed(name)
        if not low <= si <= high:
            ends = f"{with_unit(low, unit)} to {with_unit(high, unit)}"
            raise InputError(name, with_unit(si, unit), f"the rig {self.rig.name} allows {ends} by hand")
        return si

    def allowed(self, name: str) -> tuple[float, float]:
        """Return the limits of a set-point [SI]."""
        limits, speed = self.limits, float(self.manual.speed)
        if name == "pressure":
            return limits.pressure[0], min(limits.pressure[1], limits.burst_pressure)
        if name == "span":
            return limits.span
        if name == "velocity":
            return -speed, speed
        return 0.0, min(limits.tension, limits.motor_force, float(self.watch.most_tension))

    def closed(self, begin: np.ndarray | None, end: np.ndarray | None) -> Accounts | None:
        """Close the accounts of a simulated machine between two of its states; None of a real one."""
        if self._own is None or self._simulated is None or begin is None or end is None:
            return None
        machine = self._simulated.machine
        return self._own.closed(machine.carry(end), machine.carry(begin))


def _manual_operation(span: str, rate: float) -> dict[str, JsonValue]:
    """Return the protocol document of manual operation, vented at a span."""
    return {
        "schema": 1, "name": "manual", "title": "Manual operation", "sample_rate": f"{rate!r} Hz",
        "note": "Set-points were given by hand; the events tell which, and when.",
        "steps": [{"label": "by hand, beginning with", "pressure": "0 bar", "span": span, "for": "1 s"}],
    }  # fmt: skip
