"""Equal protocols for braided and biological muscles: twitch, step, quick release, force-velocity, work loop.

A McKibben muscle does them on a simulated test machine, valve, tube and motor included; a biological one as `fibre` says.
Both do the same steps: pressures as shares of the full pressure, loads as shares of F0, lengths in L0, speeds in L0/s. The
same analysis then reads both recordings by their channels ``span``, ``tension`` and ``drive``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np

from ...analysis.channels import smoothed
from ...analysis.loops import loop
from ...analysis.segments import segments
from ...analysis.shortening import fit_hill, force_velocity_point, power_density
from ...analysis.steps import step_responses, twitch, unsettled
from ...answers import brief
from ...assembly.muscle_unit import MuscleUnit
from ...bench.biological_run import fibre_run
from ...bench.prepare import prepare
from ...bench.rig import Rig
from ...bench.run import run
from ...errors import ConvergenceError, InputError
from ...experiments.protocol import Protocol
from ...experiments.read import build_protocol, parse_protocol, protocol, with_values
from ...recordings import Channel, Recording
from .table import ComparedMuscle, MuscleColumn, law_column

# The first that takes all muscles of a comparison; with wall heat the paper's valve is too slow for a twitch of 50 ms.
RIGS = ("paper", "paper-isothermal", "modern")
PULSE = 0.05  # of the twitch: the valve of the paper needs 48 ms to fill the muscle [s]
SPEEDS = (0.1, 0.5, 1.0, 2.0, 4.0)  # of the isokinetic shortening [L0/s]
FROM, TO, AT = 1.0, 0.85, 0.92  # lengths where it begins and ends, and where it is read [L0]
LOAD = 0.5  # after the release [F0]
SETTLED = 0.02  # within which the tension has to settle before it [F0]
FREQUENCY, CYCLES = 1.0, 3  # of the work loop [Hz]
MEAN, AMPLITUDE = 0.9, 0.08  # lengths of the work loop, those of the shipped one [L0]
STIMULATION = ("phase", "duty", "rate", "width")  # of a biological muscle in the work loop
SHORTENING, LENGTHENING = 0.9, 0.24  # drive in the work loop, the shipped 4.5 and 1.2 bar over 5 bar [1]
WINDOW = 0.006  # over which velocities are taken [s]
STIFF_AT = 0.9  # length at which stiffness is compared with tension, where neither muscle is at an end [L0]
RANKS = 4.0  # a Hill number whose interval is wider than this factor is not identified
FULL = 5e5  # what the protocols of a biological muscle call full; it cancels [Pa]
NAMES = ("isometric-twitch", "isometric-step", "quick-release", "isokinetic", "work-loop")
_QUICK, _SLOW = 0.003, 0.02  # windows over which curves for a figure are averaged [s]
_HALF = float(np.nextafter(0.5, 1.0))  # responses are timed to more than half of the step
Curve = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Trials:
    """Results of a muscle in all protocols: recordings by protocol, numbers by property [SI], and curves for a figure.

    Curves are normalised: ``twitch``, ``rise`` and ``fall`` are tension over F0 against seconds since the command,
    ``release`` length over L0 against seconds, ``force_velocity`` tension over the isometric one against L0/s,
    ``work_loop`` tension over F0 against L/L0, ``stiffness`` dF/dL L0/F0 against tension over F0, ``force_length`` and
    ``passive`` static tension over F0 against L/L0.
    """

    muscle: ComparedMuscle
    records: Mapping[str, Recording]
    values: Mapping[str, float]
    curves: Mapping[str, Curve]
    notes: tuple[str, ...]

    __repr__ = brief

    def column(self) -> MuscleColumn:
        """Column of the table with these numbers and those of the law."""
        of_law = law_column(self.muscle)
        values = {**of_law.values, **self.values}
        return MuscleColumn(of_law.name, of_law.title, "law and protocols", values, of_law.notes + self.notes)


def normalised(name: str, muscle: ComparedMuscle, stimulation: Mapping[str, str] | None = None) -> Protocol:
    """Scale a protocol to a muscle: full pressure, loads over F0.

    Args:
        name: one of `NAMES`.
        muscle: which.
        stimulation: values of the stimulation by which a biological muscle does the work loop, see `STIMULATION`; without
            it its excitation is the pressure of a McKibben muscle over the full pressure.

    Raises:
        InputError: if it is none of `NAMES`, or the stimulation is out of its bounds.
    """
    if stimulation is not None and name == "work-loop" and muscle.fibre is not None:
        return stimulated_loop(stimulation)
    full = muscle.full if muscle.unit is not None else FULL
    pull = muscle.full_tension
    if name == "isometric-twitch":
        return with_values(_twitch(), {"high": f"{full!r} Pa", "width": f"{PULSE!r} s"})
    values: dict[str, dict[str, Any]] = {
        "isometric-step": {"range": "full", "high": f"{full!r} Pa", "cycles": 1},
        "quick-release": {"pressure": f"{full!r} Pa", "load": f"{LOAD * pull!r} N", "after": "0.3 s"},
        "isokinetic": {
            "pressure": f"{full!r} Pa",
            "longest": f"{FROM} L0",
            "shortest": f"{TO} L0",
            "rest": "0.3 s",
            "speed": [f"{v} L0/s" for v in SPEEDS],
        },
        "work-loop": {
            "shortening": f"{SHORTENING * full!r} Pa",
            "lengthening": f"{LENGTHENING * full!r} Pa",
            "frequency": f"{FREQUENCY} Hz",
            "cycles": CYCLES,
        },
    }
    if name not in values:
        raise InputError("protocol", name, known=NAMES)
    wanted = protocol(name, **values[name])
    return _settling(wanted, SETTLED * pull) if name == "quick-release" else wanted


def stimulated_loop(stimulation: Mapping[str, str]) -> Protocol:
    """The work loop of a biological muscle by stimulation, over the lengths and at the frequency of the other muscles.

    Raises:
        InputError: a value is unknown or out of its bounds.
    """
    for key in stimulation:
        if key not in STIMULATION:
            raise InputError("stimulation", key, known=STIMULATION)
    shape = {"mean": f"{MEAN} L0", "amplitude": f"{AMPLITUDE} L0", "frequency": f"{FREQUENCY} Hz", "cycles": CYCLES}
    return with_values(protocol("stimulated-work-loop", **shape), stimulation)


@functools.cache
def _twitch() -> Protocol:
    file = resources.files(__package__) / "isometric-twitch.toml"
    return parse_protocol(file.read_text(encoding="utf-8"), where="isometric-twitch.toml")


def _settling(wanted: Protocol, within: float) -> Protocol:
    """Change the release to wait until the tension has settled within an amount [N].

    The shipped half newton is much to one muscle, and little more than a count of its cell to another.
    """
    document = wanted.document()
    for step in document["steps"]:
        if "until" in step:
            step["until"] = f"tension settled within {within!r} N for 0.5 s"
    return build_protocol(document, where=wanted.name)


def rig_for(muscles: Sequence[ComparedMuscle], names: Sequence[str] = NAMES) -> str:
    """First of `RIGS` on which the dry run passes for every McKibben muscle; the last if there is none."""
    braided = [m for m in muscles if m.unit is not None]
    for name in RIGS[:-1]:
        benches = (prepare(normalised(n, m), muscle=m.spec, unit=m.unit, rig=name) for m in braided for n in names)
        if not any(b.findings for b in benches):
            return name
    return RIGS[-1]


def record_of(
    muscle: ComparedMuscle, wanted: Protocol, *, rig: Rig | str = RIGS[0], unit: MuscleUnit | None = None
) -> Recording:
    """Run a protocol on a muscle and record it, with the channels ``span``, ``tension`` and ``drive``.

    Args:
        muscle: which.
        wanted: the protocol.
        rig: on which a McKibben muscle does it.
        unit: what does it in place of the muscle as built, such as one with elements added.

    Raises:
        InputError: the dry run found something, such as a tension beyond the rig's cell.
        ConvergenceError: the run stopped before its end.
    """
    if muscle.fibre is not None:
        record = fibre_run(muscle.fibre, wanted, full_pressure=FULL, name=muscle.id)
        return record.with_channels({"drive": Channel(record["excitation"], "1", "command", "excitation")})
    bench = prepare(wanted, muscle=muscle.spec, unit=unit or muscle.unit, rig=rig)
    record = run(bench)
    if record.meta["result"] != "done":
        raise ConvergenceError(f"{wanted.name}, {muscle.id}: {record.meta['message']}")
    drive = Channel(record["valve.command"] / muscle.full, "1", "command", "pressure asked for, over the full one")
    return record.with_channels({"drive": drive})


def trials(
    muscle: ComparedMuscle,
    *,
    rig: Rig | str | None = None,
    names: Sequence[str] = NAMES,
    stimulation: Mapping[str, str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Trials:
    """Run every protocol on one muscle.

    Args:
        muscle: which.
        rig: on which a McKibben muscle does them; as `rig_for` says by default.
        names: names of the protocols.
        stimulation: values of the stimulation in the work loop of a biological muscle, as of `normalised`.
        progress: called with a description of the next stage.

    Raises:
        InputError: the rig can do none of them with this muscle; where it can do some, a note says what it refused.
        ConvergenceError: a run stopped before its end.
    """
    tell = progress or (lambda _: None)
    records, values, curves, notes = {}, {}, static_curves(muscle), []
    half = stiffness_at_half(*curves["stiffness"])
    if half is not None:
        values["stiffness_at_half"] = half
    on = rig_for([muscle], names) if rig is None else rig
    refused: InputError | None = None
    if muscle.unit is not None:
        notes.append(f"protocols on the rig {on if isinstance(on, str) else on.name}")
    for name in names:
        tell(f"{muscle.id}: {name}")
        try:
            records[name] = record_of(muscle, normalised(name, muscle, stimulation), rig=on)
        except InputError as error:  # what the dry run found; other protocols may ask for less
            refused = error
            notes.append(f"no {name}: {error}")
            continue
        numbers, drawn, said = _READ[name](muscle, records[name])
        values, curves, notes = values | numbers, curves | drawn, notes + said
    if refused is not None and not records:
        raise refused
    return Trials(muscle, records, values, curves, tuple(notes))


def static_curves(muscle: ComparedMuscle) -> dict[str, Curve]:
    """Curves that need no protocol: tension against length, fully driven and passive, and stiffness against tension."""
    low, high = (0.55, 1.6) if muscle.fibre is not None else (0.55, muscle.upper_length / muscle.rest_length)
    lengths, drives = np.linspace(low, high, 181), np.linspace(0.0, 1.0, 41)
    at = np.full(drives.shape, STIFF_AT)
    return {
        "force_length": (lengths, muscle.tension(lengths)),
        "passive": (lengths, muscle.tension(lengths, 0.0)),
        "stiffness": (muscle.tension(at, drives), muscle.stiffness(at, drives)),
    }


def stiffness_at_half(tension: np.ndarray, stiffness: np.ndarray) -> float | None:
    """Stiffness at half of F0 on a curve of growing tension; None if it does not get there."""
    if not tension.max() > 0.5:
        return None
    return float(np.interp(0.5, tension, stiffness))


# ---- content of each recording

Read = tuple[dict[str, float], dict[str, Curve], list[str]]


def _read_twitch(muscle: ComparedMuscle, record: Recording) -> Read:
    start = float(segments(record, "twitch")[0].time[0])
    timing = twitch(record, stimulus=start, tension="tension")
    values = {
        "twitch_tension": timing.peak / muscle.full_tension,
        "twitch_contraction_time": timing.contraction_time,
        "twitch_half_relaxation_time": timing.half_relaxation_time,
    }
    return values, {"twitch": _against_time(muscle, record, start, record.time[-1])}, []


def _read_step(muscle: ComparedMuscle, record: Recording) -> Read:
    steps = segments(record, "steps")[0]
    start = float(steps.time[0])
    near = record.select(start - 0.2, float(steps.time[-1]))
    whole = step_responses(near, command="drive", channel="tension")
    half = step_responses(near, command="drive", channel="tension", reached=_HALF)
    up, down = (next(r for r in whole if r.rising == way) for way in (True, False))
    half_up, half_down = (next(r for r in half if r.rising == way) for way in (True, False))
    values = {
        "step_delay": up.delay,
        "step_rise": up.transition,
        "step_fall": down.transition,
        "step_half_rise": half_up.transition,
        "step_half_fall": half_down.transition,
    }
    curves = {
        "rise": _against_time(muscle, near, up.command_time, down.command_time - 0.001),
        "fall": _against_time(muscle, near, down.command_time, near.time[-1]),
    }
    return values, curves, [said for r in (up, down) if (said := unsettled(r, "tension"))]


def _against_time(muscle: ComparedMuscle, record: Recording, start: float, end: float) -> Curve:
    """Relative tension from shortly before a command on; counts and noise of a real cell are averaged slightly."""
    part = record.select(start - 0.02, end)
    pull = smoothed(part["tension"], period=part.period, window=_QUICK)
    return part.time - start, pull / muscle.full_tension


def _read_release(muscle: ComparedMuscle, record: Recording) -> Read:
    part = segments(record, "release")[0]
    time, length = part.time - part.time[0], part["span"] / muscle.rest_length
    done = float(length[0] - length[-1])
    speed = -smoothed(length, period=part.period, window=WINDOW, derivative=1)
    half = np.flatnonzero(length <= length[0] - 0.5 * done)
    values = {
        "release_velocity": float(speed.max()),
        "release_shortening": done,
        "release_half_time": float(time[half[0]]) if done > 0.0 and half.size else float("nan"),
    }
    return values, {"release": (time, length)}, []


def _read_velocity(muscle: ComparedMuscle, record: Recording) -> Read:
    """Tension against velocity at one length, over the static tension there."""
    isometric = float(muscle.tension(AT)) * muscle.full_tension
    parts = segments(record, "shorten")
    at = AT * muscle.rest_length
    points = [force_velocity_point(p, at_length=at, length="span", tension="tension", window=WINDOW) for p in parts]
    speed = np.array([p.velocity for p in points]) / muscle.rest_length
    pull = np.array([p.tension for p in points]) / isometric
    values = {"tension_at_speed": float(np.interp(1.0, speed, pull))}
    with np.errstate(over="ignore"):  # of a curve that does not fall, nothing bounds the largest velocity
        hill = fit_hill(np.append(0.0, speed), np.append(1.0, np.maximum(pull, 0.0)))
    if hill.maximum_velocity.high < RANKS * hill.maximum_velocity.low:
        values |= {"hill_velocity": hill.maximum_velocity.value, "hill_curvature": hill.curvature.value}
        notes = []
    else:
        notes = [f"no hyperbola of Hill follows from {SPEEDS[0]:g} to {SPEEDS[-1]:g} L0/s"]
    return values, {"force_velocity": (np.append(0.0, speed), np.append(1.0, pull))}, notes


def _read_loop(muscle: ComparedMuscle, record: Recording) -> Read:
    part = segments(record, "cycles")[0]
    work = loop(part, length="span", tension="tension", skip=1).work  # the first begins at rest, and does not return
    last = part.select(part.time[0] + (CYCLES - 1) / FREQUENCY, None)
    pull = smoothed(last["tension"], period=last.period, window=_SLOW)
    curve = last["span"] / muscle.rest_length, pull / muscle.full_tension
    values = {"cycle_work": work / (muscle.full_tension * muscle.rest_length)}
    if muscle.section_area is not None:
        size = {"section_area": muscle.section_area, "rest_length": muscle.rest_length}
        values["cycle_work_density"] = power_density(work, **size)
        values["cycle_power_density"] = power_density(work * FREQUENCY, **size)
    return values, {"work_loop": curve}, []


_READ: dict[str, Callable[[ComparedMuscle, Recording], Read]] = {
    "isometric-twitch": _read_twitch,
    "isometric-step": _read_step,
    "quick-release": _read_release,
    "isokinetic": _read_velocity,
    "work-loop": _read_loop,
}
