"""Two muscles on a joint, driven by commands of their valves or by set-points of angle and stiffness, as a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import verbs
from ..answers import Answer, Caution, Column, Table, collect
from ..documents import JsonValue
from ..errors import InputError
from ..muscles.evidence import interval_remarks
from ..quantities import parse, with_unit
from ..recordings import Recording, read_record
from ..recordings.memory import STEPPED, check_memory
from ..simulation import Air, Joint, Simulation

SHOWN = ("joint.angle", "joint.velocity", "joint.moment", "flexor.pressure", "extensor.pressure")
REPORTED = 1000  # steps between two reports of the progress


@dataclass(frozen=True)
class JointRecording(Answer):
    """A run of two muscles on a joint: what `record_joint` computes.

    Attributes:
        recording: angle, moment and pressures over time.
        controlled: whether a rig's controller held set-points.
        cautions: about the joint, and what the run found.
    """

    recording: Recording
    controlled: bool
    cautions: tuple[Caution, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """Channels in numbers [SI], how long the run was [s], and shares that its balances leave open."""
        return {
            "law_error": self.recording.meta.get("law_error"),
            "channels": self.recording.summary(),
            "duration": self.recording.duration,
            "balance": dict(self.recording.meta["balance"]),
        }

    def tables(self) -> list[Table]:
        """Joint and pressures at the start, between, and at the end."""
        rows: list[dict[str, Any]] = []
        for name in SHOWN:
            values = self.recording[name]
            numbers = {"start": values[0], "least": values.min(), "largest": values.max(), "end": values[-1]}
            shown = {k: float(v) for k, v in numbers.items()}
            rows.append({"channel": name, "unit": self.recording.unit(name)} | shown)
        columns = (Column(key, own="unit") for key in ("start", "least", "largest", "end"))
        return [Table(str(self.recording.meta["title"]), (Column("channel"), *columns), rows)]

    def remarks(self) -> list[str]:
        """How long it was, and its balances."""
        closed = ", ".join(f"{name} {share:.0e}" for name, share in dict(self.recording.meta["balance"]).items())
        samples = f"{len(self.recording)} samples in {self.recording.duration:g} s."
        errors: Any = self.recording.meta.get("law_error") or {}
        return [f"{samples} Missing in the balances: {closed}.", *interval_remarks(errors)]


@verbs.verb
def record_joint(
    flexor: verbs.MuscleName = "nylon",
    extensor: verbs.MuscleName | None = None,
    *,
    play: verbs.RecordFile | None = None,
    commands: verbs.Courses | None = None,
    angle: verbs.Course | None = None,
    stiffness: verbs.Course = "1 N*m/rad",
    duration: verbs.Duration | None = None,
    arm: verbs.SmallLength = "2 cm",
    inertia: verbs.Inertia = "2e-3 kg*m^2",
    supply: verbs.Pressure = "6 bar",
    valve: verbs.ValveName = "MPYE-5-1-8-LF",
    start_pressure: verbs.Pressure = "2 bar",
    period: verbs.Duration = "2 ms",
    seed: verbs.Seed = 0,
    progress: Callable[[float, float], None] | None = None,
) -> JointRecording:
    """Run two muscles on a joint, by valve commands over time or by set-points of angle and stiffness.

    Without set-points the commands drive the valves directly: of a spool valve -1 vents and 1 fills. With set-points the
    controller of the rig 'modern' holds angle and stiffness.

    Args:
        flexor: flexor, the muscle that turns the joint to positive angles.
        extensor: extensor, its antagonist; of the same kind by default.
        play: table of valve commands over time, or a recording with its commands.
        commands: command over time, such as flexor='0, 0.3 @ 0.2 s'.
        angle: set-points of the angle, such as '0 deg, 17 deg @ 0.3 s'.
        stiffness: set-points of the stiffness, beside those of the angle.
        duration: duration of the run [s], such as '2 s'; that of the table, else 1 s, by default.
        arm: moment arm of both muscles [m].
        inertia: moment of inertia about the axis [kg*m^2].
        supply: gauge pressure of the supply [Pa], without set-points.
        valve: valve of each muscle, without set-points.
        start_pressure: gauge pressure of both muscles at the start [Pa], without set-points.
        period: period of the commands [s], without set-points.
        seed: random seed for sensor noise; equal seeds give equal recordings.
        progress: told how far the run is, and how long it is [s].

    Raises:
        InputError: names what does not fit.
    """
    if angle is not None:
        if play is not None or commands:
            problem = "must stand without {play} and {commands}, which drive the valves directly"
            raise InputError("angle", angle, problem)
        seconds = 1.0 if duration is None else float(duration)
        courses = {"angle": _course(angle, "rad", "angle"), "stiffness": _course(stiffness, "N*m/rad", "stiffness")}
        from ..assembly.loads import MomentArm
        from ..bench.joint_run import SPAN, joint_stand, run_joint

        bends = MomentArm(coefficients=np.array([float(arm)]), span=SPAN)
        stand = joint_stand(flexor, extensor, flexor_arm=bends, inertia=float(inertia))
        recording = run_joint(
            stand, duration=seconds, angle=courses["angle"], stiffness=courses["stiffness"], seed=seed
        )
        own = collect(*(_late_caution(name, course, seconds) for name, course in courses.items()))
    else:
        # a value with its text, so that sentences call it as it was typed
        arm, inertia, supply, period, start_pressure = (
            getattr(one, "text", one) for one in (arm, inertia, supply, period, start_pressure)
        )
        system = Joint(flexor, flexor if extensor is None else extensor, arm=arm, inertia=inertia)
        simulation = Simulation(system, Air(supply=supply, valve=valve), period=period)
        courses, seconds, said = ({}, 1.0, []) if play is None else _table(play, simulation.commands)
        courses |= _courses(simulation, commands or {})
        seconds = seconds if duration is None else float(duration)
        _play(simulation, courses, seconds, start_pressure, progress)
        recording = simulation.recording()
        late = (_late_caution(f"command {name}", course, seconds) for name, course in courses.items())
        own = collect(*said, *simulation.cautions, *late)
    known = {one.text for one in own}
    found = (Caution(text) for text in recording.meta.get("warnings", ()) if text not in known)
    return JointRecording(recording, angle is not None, collect(*own, *found))


def _courses(simulation: Simulation, commands: Mapping[str, str]) -> dict[str, _HeldValues]:
    """Commands over time, in the units of their valves."""
    courses = {}
    for name, text in commands.items():
        if name not in simulation.commands:
            raise InputError("commands", name, known=simulation.commands)
        unit = next(d.unit for d in simulation.drives if d.command == name)
        courses[name] = _course(text, unit, f"commands.{name}")
    return courses


def _play(
    simulation: Simulation,
    courses: Mapping[str, _HeldValues],
    seconds: float,
    start: Any,
    progress: Callable[[float, float], None] | None,
) -> None:
    """Step a simulation by commands over time."""
    period = simulation.period
    count = round(seconds / period)
    if count < 1:
        raise InputError("duration", with_unit(seconds, "s"), f"must be {period:g} s or more, one period")
    check_memory(seconds, period, bytes_per_sample=STEPPED, field="duration")
    times = period * np.arange(count)
    rows = {name: course(times).tolist() for name, course in courses.items()}
    simulation.reset(pressure=start)
    for k in range(count):
        if k % REPORTED == 0 and progress is not None:
            progress(k * period, seconds)
        simulation.step(**{name: values[k] for name, values in rows.items()})


def _table(source: Any, known: tuple[str, ...]) -> tuple[dict[str, _HeldValues], float, list[Caution]]:
    """Commands over time from the columns of a table or a recording, how long it is [s], and what is not used."""
    record = source if isinstance(source, Recording) else read_record(source)
    courses = {}
    for name in known:
        column = next((c for c in (name, f"{name}.command") if c in record), None)
        if column is not None:
            courses[name] = _HeldValues(record.time - record.time[0], record[column])
    if not courses:
        has = ", ".join(record.names())
        raise InputError("play", str(source), f"must have a column named {' or '.join(known)}; it has {has}")
    said = [one for one in record.cautions if one.parameter == "source"]
    if "fingerprint" not in record.meta:  # of a table; a recording has more than its commands
        unused = [name for name in record.names() if name not in known and name not in (f"{n}.command" for n in known)]
        words = f"{Path(source).name} has columns that are no command, and are not used: {', '.join(unused)}"
        said += [Caution(words)] if unused else []
    return courses, float(record.time[-1] - record.time[0]), said


class _HeldValues:
    """Values that hold from their times on."""

    def __init__(self, times: np.ndarray, values: np.ndarray) -> None:
        self.times, self.values = times, values

    def __call__(self, at: np.ndarray) -> np.ndarray:
        # a sample a rounding before its time belongs to it
        places = np.searchsorted(self.times, at + 1e-9, side="right") - 1
        return np.asarray(self.values[np.maximum(places, 0)], float)


def _late_caution(name: str, course: _HeldValues, seconds: float) -> Caution | None:
    """Caution about values that would begin when the run has ended [s]."""
    late = course.times[course.times >= seconds]
    if not late.size:
        return None
    said = f"{name} changes at {with_unit(float(late[0]), 's')}, and the run ends at {with_unit(seconds, 's')}"
    return Caution(f"{said}: what begins then is left out", name)


def _course(text: str, unit: str, field: str) -> _HeldValues:
    """Values over time from ``0 deg, 17 deg @ 0.3 s``: each holds from its time on, the first from the start."""
    times, values = [], []
    for k, part in enumerate(text.split(",")):
        value, at, time = part.partition("@")
        if bool(at) != (k > 0):
            problem = "must be a value, and further ones with their times, such as '0, 0.3 @ 0.2 s'"
            raise InputError(field, text, problem)
        values.append(parse(value.strip(), unit, field=field))
        times.append(parse(time.strip(), "s", field=field) if at else 0.0)
    if any(b <= a for a, b in zip(times, times[1:], strict=False)):
        raise InputError(field, text, "must have rising times")
    return _HeldValues(np.array(times), np.array(values))
