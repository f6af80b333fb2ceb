"""What a session needs before anything moves: the machine, its manual software, and what may be asked of it by hand."""

from __future__ import annotations

import os
from typing import Any

import jax.numpy as jnp

from ...assembly.accounts import Accounts
from ...assembly.build import unit_from_specimen
from ...assembly.muscle_unit import MuscleUnit
from ...errors import InputError
from ...experiments.amounts import CHANNELS, read_amount
from ...experiments.dry_run import check
from ...experiments.read import build_protocol
from ...quantities import with_unit
from ...specimens import Specimen, specimen
from ..hardware.interface import Hardware
from ..hardware.ongoing import AtSpeed, Ground, Ongoing
from ..rig import Rig
from ..rig_file import rig as rig_of
from ..segment import SegmentMachine, software_of, timing_of
from ..software.loop import BenchSoftware
from ..software.manual import Manual
from ..software.sequencer import SPAN, TENSION, VELOCITY
from .run import OnMachine, prepared

RATE = 1000.0  # samples per second, where the computer can [1/s]
MODES = {"span": SPAN, "velocity": VELOCITY, "tension": TENSION}


class Setup:
    """A rig with a muscle, ready to be operated.

    Args:
        rig: itself, its name or file.
        muscle: a specimen, its id or file, or a muscle.
        hardware: a machine at the border; None: a simulated one.
        unit: what was built from the specimen, where something of it was changed.
        span: at which it is mounted, in words or [m]; the rest length where left out.
        plumbing: the way to join the pneumatic parts.
        rate: samples per second [1/s].
        speed: of a simulated machine over the wall clock; None: it goes only while somebody waits.
        seed: of the sensors' noise.
        step: largest step of the physics [s].
        hold: time for which set-points are held without a hand [s].

    Raises:
        InputError: names what is unknown, or that the machine may not even stand there.
    """

    def __init__(
        self, rig: Rig | str | os.PathLike[str], muscle: Specimen | MuscleUnit | str, hardware: Hardware | None, *,
        unit: MuscleUnit | None, span: float | str | None, plumbing: str | None, rate: float | None,
        speed: float | None, seed: int, step: float, hold: float,
    ) -> None:  # fmt: skip
        self.rig = rig if isinstance(rig, Rig) else rig_of(rig)
        spec = muscle if isinstance(muscle, MuscleUnit | Specimen) else specimen(muscle)
        if isinstance(spec, Specimen) and unit is None:
            unit = unit_from_specimen(spec)
        computer = self.rig.computer
        self.rate = min(max(RATE, float(computer.lowest_rate)), float(computer.highest_rate)) if rate is None else rate
        if speed is not None and not speed > 0.0:
            raise InputError("speed", speed, "allowed is a factor above zero")
        self.options: dict[str, Any] = {
            "muscle": spec, "unit": unit, "rig": self.rig, "seed": seed, "step": step, "plumbing": plumbing,
        }  # fmt: skip
        place = "1 L0" if span is None else span if isinstance(span, str) else f"{span!r} m"
        operation = build_protocol(_by_hand(place, self.rate), where="session")
        self.bench: OnMachine = prepared(operation, self.rate, **self.options)
        check(list(self.bench.findings), where="session")
        self.options["plumbing"] = self.bench.layout
        self.timing, (self.part,) = timing_of(self.bench), tuple(self.bench.segments())
        self.limits = self.rig.limits(self.bench.layout)
        self.manual = Manual.of(self.limits, hold=hold)
        self.watch = self.rig.watch(self.bench.layout)
        self.converters = self.rig.converters(self.part.start_span)
        part = self.part
        self.machine = self.rig.machine(part.layout, self.bench.unit, start=part.start_span, moves=part.moves)
        self._own = SegmentMachine(self.bench, 0, part, self.timing) if hardware is None else None
        self.ground = Ground(hardware or self._simulated(speed), self.timing.period)

    def _simulated(self, speed: float | None) -> AtSpeed:
        own, timing = self._own, self.timing
        assert own is not None
        machine = Ongoing(
            own.plant, own.rested, own.rows, period=timing.period, inner=timing.inner, latency=timing.latency
        )  # fmt: skip
        return AtSpeed(machine, speed)

    def software(self) -> BenchSoftware:
        """That of manual operation; it begins vented, where the machine is."""
        found = software_of(self.bench, self.part, self.timing)
        return found.replace(sequencer=self.manual, start_motor=jnp.asarray(jnp.nan))

    def amount(self, name: str, value: float | str) -> float:
        """What is asked for by hand, in words or SI, within what the rig allows [SI].

        Raises:
            InputError: names what is allowed.
        """
        unit = CHANNELS[name]
        si = (
            read_amount(value, unit, field=name).si(self.bench.plan.rest_length)
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
        """Least and most of a set-point [SI]."""
        limits, speed = self.limits, float(self.manual.speed)
        if name == "pressure":
            return limits.pressure[0], min(limits.pressure[1], limits.burst_pressure)
        if name == "span":
            return limits.span
        if name == "velocity":
            return -speed, speed
        return 0.0, min(limits.tension, limits.motor_force, float(self.watch.most_tension))

    def closed(self, begin: Any, end: Any) -> Accounts:
        """The accounts of a simulated machine between two of its states, as `ongoing.Ongoing.state` gives them."""
        machine = self.ground.machine
        assert machine is not None and self._own is not None
        return self._own.closed(machine.carry_of(end), machine.carry_of(begin))


def _by_hand(span: str, rate: float) -> dict[str, Any]:
    """The protocol that a recording by hand tells of: where it began, vented."""
    return {
        "schema": 1, "name": "manual", "title": "Manual operation", "sample_rate": f"{rate!r} Hz",
        "note": "Set-points were given by hand; the events tell which, and when.",
        "steps": [{"label": "by hand, beginning with", "pressure": "0 bar", "span": span, "for": "1 s"}],
    }  # fmt: skip
