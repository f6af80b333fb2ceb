"""Characterisation of an unknown muscle on a rig, from the first stage to the fitted specimen; resumable by stages."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from ... import verbs
from ...accessors import implementation
from ...answers import Answer, Caution, Column, Table, collect, estimates, named
from ...assembly.build import rig_unit
from ...assembly.muscle_unit import MuscleUnit
from ...bench.hardware.backends import check_connection, connected
from ...bench.hardware.interface import Hardware
from ...bench.prepare import PreparedRun, prepare, prepare_on_machine
from ...bench.rig import Rig
from ...bench.rig_file import rig as rig_of
from ...bench.session import Session
from ...bench.session.interface import session_rate
from ...documents import JsonValue, parse_json, read_text, write_text
from ...errors import EmptyRunError, InputError, StageError
from ...experiments.protocol import Protocol
from ...identification.ranking import assumptions, known_in_si
from ...muscles import Muscle
from ...muscles.build import build_law, rest_length_of
from ...muscles.elements import Tendon
from ...muscles.laws import law_type
from ...quantities import in_si, named_values, with_unit
from ...recordings import Recording
from ...recordings.files import read_recording
from ...specimens import Specimen, muscle_specimen, save_specimen
from ...verbs import ParameterType
from ..next_measurement import NextReadings
from .evaluation import MOST_ERROR, MOST_GAIN, Evaluation, advance, evaluate, muscle_of, specimen_of
from .stages import ISOBARS, LENGTH_ERROR, OTHER_STAGES, STAGES, Bounds, Progression, planned, protocol_of

if TYPE_CHECKING:
    from ...estimation import Estimate

SETTINGS = "characterisation.json"  # in the folder: what its recordings were made with
REPORT = "report.html"  # in the folder
POINTS = "points.csv"  # in the folder: points of the map, without friction and relaxation
# Settings that are digests, and what of.
CONTENTS = {"rig_digest": "rig", "muscle_digest": "muscle", "make_digest": "make"}
LESS = 0.7  # of the largest tension, to be asked for where the rig's interlock has stopped a stage
LEAST_TOE = 1e-6  # stretch over which a cord of a stated stiffness gets stiff [m]
MOST_MISREAD = 0.2  # of its rest length, by which a ruler may miss that of a simulated muscle
_NUMBERED = [*STAGES, *OTHER_STAGES]
SATURATED = 2.0  # counts from the top of a converter at which a reading says nothing
Sizes = Annotated[Any, ParameterType("NAME=VALUE")]  # by name, numbers [SI] or text
Progress = Callable[[float, float, str], None]  # machine time done and planned [s], and the stage


@dataclass(frozen=True)
class StageRecord:
    """A stage that was run: name, machine time [s], and whether it was read from the folder."""

    stage: str
    seconds: float
    resumed: bool


@dataclass(frozen=True, repr=False)
class Characterisation(Answer):
    """A muscle that was characterised on a rig.

    Attributes:
        rig: name of the rig.
        bounds: that nothing exceeded.
        stages: as they were run.
        evaluation: points, fits and held-out errors.
        specimen: law, friction, relaxation and leak, with their intervals.
        records: recordings of the stages.
        cautions: what must be known before the specimen is used.
        folder: of recordings, report and specimen; None where nothing was written.

    Examples:
        >>> import mckibben as mk
        >>> found = mk.characterise("modern", muscle="nylon")    # doctest: +SKIP
        >>> found.muscle.tension("12 cm", "4 bar")               # doctest: +SKIP
    """

    rig: str
    bounds: Bounds
    stages: tuple[StageRecord, ...]
    evaluation: Evaluation
    specimen: Specimen
    records: dict[str, Recording]
    cautions: tuple[Caution, ...] = ()
    folder: Path | None = None

    def __repr__(self) -> str:
        state = "passed" if self.passed else "failed"
        share = 100.0 * self.held_out_error
        return f"Characterisation({self.specimen.id!r}, {self.law}, held-out error {share:.2g} %, {state})"

    @property
    def muscle(self) -> Muscle:
        """The fitted muscle with friction and relaxation."""
        return muscle_of(self.evaluation, self.specimen)

    @property
    def law(self) -> str:
        """Name of the law that describes the map best."""
        return self.evaluation.fits[0].law

    @property
    def seconds(self) -> float:
        """Machine time of all stages [s]."""
        return sum(s.seconds for s in self.stages)

    @property
    def held_out_error(self) -> float:
        """Root mean square error of the held-out points, as a share of the largest tension."""
        return float(np.sqrt(np.mean(self.evaluation.error**2))) / self.evaluation.largest

    @property
    def measured_pressures(self) -> tuple[float, float]:
        """Lowest and highest gauge pressure of the map's points [Pa]; at a loop below the lowest the muscle was slack."""
        pressure = self.evaluation.points.pressure
        return float(pressure.min()), float(pressure.max())

    @property
    def tells_gain(self) -> bool:
        """Whether the loop that was measured again tells a gain that drifts: not where what relaxes hides it."""
        change = self.evaluation.gain_change
        return change.high - change.low <= 2.0 * MOST_GAIN

    @property
    def failed_stage(self) -> tuple[str, str]:
        """The stage whose outcome speaks against the specimen, and why; both empty if nothing does."""
        change = self.evaluation.gain_change
        if self.tells_gain and (change.low > MOST_GAIN or change.high < -MOST_GAIN):
            by, most = f"{100.0 * change.value:+.2g} %", f"{100.0 * MOST_GAIN:g} %"
            return (
                "held-out",
                f"the tensions of one loop of the map have changed by {by} at its repetition, more than {most}: the "
                "gain of the load cell or of the pressure sensor drifts; let both warm up, and calibrate them",
            )
        if self.held_out_error > MOST_ERROR:
            share, most = f"{100.0 * self.held_out_error:.2g} %", f"{100.0 * MOST_ERROR:g} %"
            lowest, highest = self.measured_pressures
            cause = "the muscle changes between the stages, or no law describes it"
            if lowest > highest * (1.0 - 0.5 / ISOBARS):  # of one loop only
                cause = (
                    f"it was taut at {with_unit(highest, 'Pa', 3)} only, the highest pressure, from which no law can be "
                    "told; raise the highest pressure, or take a rig with more"
                )
            return (
                "held-out",
                f"the predicted tensions are off by {share} rms of the largest tension, more than {most}; {cause}",
            )
        return "", ""

    def failure(self) -> str | None:
        """Why the specimen should not be used, naming the stage; None if nothing speaks against it."""
        stage, problem = self.failed_stage
        return str(StageError(stage, problem)) if stage else None

    @property
    def passed(self) -> bool:
        """Whether the held-out points were predicted."""
        return self.failure() is None

    def tension_interval(self, length: float, pressure: float) -> tuple[float, float]:
        """95 % interval of the static tension at a length of the muscle itself, between its clamps [N].

        It is wider than that at a span of the rig: the span may be longer than the vented muscle by `Evaluation.clamp`. What
        cord and frame stretch under tension is in it where it is known, see `characterise`; no sensor shows it.

        Args:
            length: of the muscle [m].
            pressure: gauge pressure [Pa].
        """
        law, half = self.muscle, self.evaluation.half_width
        low, high = (float(law.tension(length + by, pressure)) for by in self.evaluation.clamp)
        return max(low - half, 0.0), high + half

    @property
    def estimates(self) -> dict[str, Estimate]:
        """Parameters of law, friction, relaxation and leak with their 95 % intervals [SI]."""
        found = self.evaluation
        named = {f"law.{n}": e for n, e in found.fits[0].parameters.items()}
        named |= {f"friction.{n}": e for n, e in found.friction.parameters.items()}
        named["relaxation.1_to_30_s"] = found.relaxation.total
        return named | ({} if found.leak is None else {"leak.decay": found.leak})

    def to_dict(self) -> dict[str, JsonValue]:
        """The outcome as plain values [SI], for JSON."""
        found = self.evaluation
        return {
            "rig": self.rig,
            "law": self.law,
            "passed": self.passed,
            "failure": self.failure() or "",
            "rest_length": self.bounds.rest_length,
            "largest_tension": found.largest,
            "tension_interval": found.half_width,
            "held_out_error": self.held_out_error,
            "gain_change": found.gain_change._asdict() if np.isfinite(found.gain_change.value) else None,
            "measured_pressures": list(self.measured_pressures),
            "seat": found.seat._asdict() if np.isfinite(found.seat.value) else None,
            "clamp": list(found.clamp),
            "machine_time": self.seconds,
            "stages": [dataclasses.asdict(s) for s in self.stages],
            "estimates": {name: e._asdict() for name, e in self.estimates.items()},
            "held_out": [dataclasses.asdict(p) for p in found.held_out],
            "laws": {f.law: f.rmse for f in found.fits},
            "assumed": found.fits[0].assumed,
            "cautions": [named(one.text) for one in self.cautions],
            "cord": None if self.bounds.cord is None else float(self.bounds.cord.stiffness),
            "points": len(found.points),
        }

    def tables(self) -> list[Table]:
        """Parameters with their intervals."""
        return [estimates(f"Characterised by the law {self.law}", self.estimates)]

    def remarks(self) -> list[str]:
        """How well the held-out points were predicted, where the map lies, what drifted, and what lengths mean."""
        found = self.evaluation
        largest = with_unit(found.largest, "N", 3)
        lowest, highest = (with_unit(p, "Pa", 3) for p in self.measured_pressures)
        shortest, longest = (with_unit(end, "m", 3) for end in found.lengths)
        said = [
            f"{len(found.held_out)} held-out points: {100.0 * self.held_out_error:.2g} % rms of the largest tension, "
            f"{largest}; a predicted tension is known to {found.half_width:.2g} N (95 %).",
            f"The map is of {lowest} to {highest} and {shortest} to {longest}; beyond it the law alone answers.",
        ]
        change = found.gain_change
        if np.isfinite(change.value):
            half = 100.0 * (change.high - change.value)
            hidden = ", which is too uncertain to tell a gain that drifts: the muscle relaxes too much"
            changed = f"One loop, measured again at the end, has changed by {100.0 * change.value:+.2f} +- {half:.2f} %"
            said.append(f"{changed}{'' if self.tells_gain else hidden}.")
        (short, long), cord = (with_unit(by, "m", 2) for by in found.clamp), self.bounds.cord
        beside = f"which may be {short} to {long} longer than the vented muscle itself"
        if cord is None:
            beside += ", and under tension by what cord and clamps stretch, too, which counts as the muscle's"
        else:
            beside = f"less what cord and frame stretch, {with_unit(float(cord.stiffness), 'N/m', 3)}, {beside}"
        said.append(f"Lengths are spans of the rig, {beside}.")
        said.append(f"{self.seconds / 60.0:.1f} min of machine time.")
        written = [] if self.folder is None else [REPORT, *[f"{self.specimen.id}.toml"] * self.passed]
        return said + [f"Written: {self.folder}{os.sep}{name}" for name in written]

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write a report with tables and figures to an ``.html`` or ``.pdf`` file; returns its path."""
        written: Path = implementation("write_characterisation_report")(self, Path(path))
        return written

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the specimen, a ``.toml`` file that every command takes; returns its path."""
        heading = f"characterised on the rig {self.rig}, {len(self.evaluation.points)} points"
        save_specimen(self.specimen, path, heading=heading)
        return Path(path)


@dataclass(frozen=True)
class CharacterisationPlan(Answer):
    """What will be done: bounds, the longest time of every stage by name [s], and readings where no map is measured."""

    bounds: Bounds
    seconds: dict[str, float]
    readings: NextReadings | None = None

    @property
    def total(self) -> float:
        """Machine time at most [s]."""
        return sum(self.seconds.values())

    def to_dict(self) -> dict[str, JsonValue]:
        """Times and bounds [SI]."""
        return {
            "stages": self.seconds,
            "machine_time": self.total,
            "rest_length": self.bounds.rest_length,
            "max_pressure": self.bounds.pressure,
            "max_tension": self.bounds.tension,
            **({} if self.readings is None else self.readings.to_dict()),
        }

    def tables(self) -> list[Table]:
        """The stages and their times."""
        does = STAGES | OTHER_STAGES
        rows = [{"stage": name, "does": does[name], "seconds": time} for name, time in self.seconds.items()]
        columns = Column("stage", ""), Column("does", ""), Column("seconds", "at most", "s", "s", ".0f", beside=True)
        return [Table("Stages", columns, rows), *([] if self.readings is None else self.readings.tables())]

    def remarks(self) -> list[str]:
        """The whole time, the bounds, and what is not tested."""
        highest, largest = with_unit(self.bounds.pressure, "Pa", 3), with_unit(self.bounds.tension, "N", 3)
        shut = "" if self.bounds.shut_off or self.readings else " There is no shut-off valve, so leaks are not tested."
        return [f"At most {self.total / 60.0:.1f} min of machine time, {highest} and {largest}.{shut}"]


def plan(
    rig: Rig | str = "modern",
    *,
    rest_length: float | str,
    plumbing: str | None = None,
    max_pressure: float | str | None = None,
    max_tension: float | str | None = None,
    rest_length_error: float = LENGTH_ERROR,
) -> CharacterisationPlan:
    """Plan a characterisation without moving anything; arguments and errors as of `characterise`."""
    on = rig if isinstance(rig, Rig) else rig_of(rig)
    layout = layout_of(on, plumbing)
    bounds = bounds_of(
        on,
        layout,
        rest_length=rest_length,
        max_pressure=max_pressure,
        max_tension=max_tension,
        rest_length_error=rest_length_error,
    )
    return CharacterisationPlan(bounds, stage_times(on, layout, bounds, bounds.stages, planned(bounds)))


def bounds_of(
    rig: Rig,
    layout: str,
    *,
    rest_length: float | str,
    max_pressure: float | str | None = None,
    max_tension: float | str | None = None,
    rest_length_error: float = LENGTH_ERROR,
) -> Bounds:
    """Bounds of what is measured; arguments and errors as of `characterise`, with the name of the plumbing."""
    pressure, tension = (
        None if value is None else float(in_si(value, unit, field=name))
        for name, value, unit in (("max_pressure", max_pressure, "Pa"), ("max_tension", max_tension, "N"))
    )
    rest = float(in_si(rest_length, "m", field="rest_length"))
    return Bounds.of(
        rig, layout, rest_length=rest, pressure=pressure, tension=tension, rest_length_error=rest_length_error
    )


def stage_times(rig: Rig, layout: str, bounds: Bounds, stages: Sequence[str], known: Progression) -> dict[str, float]:
    """Longest time of each stage [s]."""
    stand_in, times = stand_in_muscle(bounds.rest_length), {}
    for stage in stages:
        prepared = prepare(protocol_of(stage, bounds, known), muscle=stand_in, rig=rig, plumbing=layout, foresee=False)
        times[stage] = prepared.plan.duration
    return times


@verbs.verb
def characterise(
    rig: verbs.RigName = "modern",
    *,
    muscle: verbs.MuscleName | None = None,
    laws: Sequence[verbs.LawName] | None = None,
    rest_length: verbs.Length | None = None,
    rest_length_error: verbs.Share = "1 %",
    plumbing: verbs.PlumbingName | None = None,
    max_pressure: verbs.Pressure | None = None,
    max_tension: verbs.Force | None = None,
    cord: verbs.Stiffness | None = None,
    known: Sizes | None = None,
    gain_error: verbs.Share = "0.2 %",
    seed: verbs.Seed = 0,
    machine: verbs.MachineName | None = None,
    lock_step: bool = False,
    out: verbs.ResultFolder | None = None,
    name: str = "characterised",
    hardware: Hardware | None = None,
    step: float = 5e-5,
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
    begun: Callable[[CharacterisationPlan], contextlib.AbstractContextManager[object]] | None = None,
) -> Characterisation:
    """Characterise an unknown muscle on a test machine: map, friction, relaxation, leak, and a fitted specimen.

    Stages are run one after the other: slack and seat, leak, pressure ramp, loops at constant pressures, a stretch with a
    hold, and held-out points; then law, friction and relaxation are fitted. Of a simulated muscle nothing is known but what
    the sensors of the rig read. A stage that fails, or held-out points that are not predicted, refuse the specimen (exit
    code 1); an interrupt vents, and keeps the stages so far.

    Args:
        rig: rig of the test machine: paper, modern, or a .toml file; it has a motor, a load cell and a pressure sensor.
        muscle: muscle of the simulated rig: id or .toml file; none on a real machine.
        laws: law to fit; all laws by default.
        rest_length: length of the vented muscle between its clamps, where it is mounted, as '300 mm'; needed on a real
            machine.
        rest_length_error: largest error of the rest length, such as '0.5 %'; a muscle that gets taut elsewhere is refused.
        plumbing: plumbing that joins the rig's pneumatic parts; one with a shut-off valve by default, if there is one.
        max_pressure: highest gauge pressure, such as '5 bar'; what the rig bears by default.
        max_tension: largest tension, such as '200 N'; what the rig bears by default.
        cord: stiffness of cord and frame in series, such as '100 N/mm', by which spans are longer than the muscle; that of a
            simulated rig by default, of a machine none.
        known: parameter that is not fitted, such as wall_thickness='0.5 mm': a size that no tension tells.
        gain_error: standard uncertainty of the gains of load cell and pressure sensor, such as '0.5 %', for the intervals.
        seed: random seed for sensor noise; equal seeds give equal recordings.
        machine: run on a real machine: serial:/dev/ttyACM0, or daq (wired as the rig file says).
        lock_step: let a simulated device wait for every command instead of following its own clock.
        out: folder of recordings, report and specimen; the same question resumes from it.
        name: id of the specimen.
        hardware: a real machine that is open already, with the muscle mounted at the rest length; it stays open.
        step: largest step of the simulated physics [s].
        progress: told the machine time done and planned [s], and the stage.
        stop: asked whether to end; the machine is vented then.
        begun: told what is planned, before anything moves; its context is open while the machine moves.

    Raises:
        InputError: an argument is out of its range, or the folder has recordings of another characterisation.
        StageError: a stage could not be finished; the recordings of the stages before stay in the folder.

    Examples:
        >>> import mckibben as mk
        >>> mk.characterise("modern", muscle="nylon", max_pressure="12 bar")
        Traceback (most recent call last):
        mckibben.errors.InputError: max_pressure must be above 0 and at most 9 bar, got 12 bar
    """
    on, unit, rest_length = mounted_muscle(rig, muscle, rest_length, hardware, machine, lock_step=lock_step)
    for law in laws or ():
        law_type(law)
    gain = float(gain_error)
    if not 0.0 <= gain <= 0.2:
        raise InputError("gain_error", gain_error, "must be between 0 and 20 %")
    sizes = known_in_si(named_values(known or {}, "known"), laws)
    if "rest_length" in sizes:
        raise InputError("known.rest_length", None, "is stated as rest_length")
    intended = plan(
        on,
        rest_length=rest_length,
        plumbing=plumbing,
        max_pressure=max_pressure,
        max_tension=max_tension,
        rest_length_error=float(rest_length_error),
    )
    bounds, layout = intended.bounds, layout_of(on, plumbing)
    bounds = dataclasses.replace(bounds, cord=holder_of(on, unit, cord))
    folder = None if out is None else recording_folder(out, settings_of(on, layout, bounds, seed, muscle))
    # the plan is told before a machine is opened, and Ctrl-C is heard until it has vented
    with (
        contextlib.nullcontext() if begun is None else begun(intended),
        connected(machine, on, 1.0 / session_rate(on), lock_step=lock_step) as opened,
        machine_for(on, layout, unit, bounds, hardware or opened, seed, step) as sampled,
    ):
        so_far, records, done = recorded_stages(sampled, intended, bounds, Progression(), folder, progress, stop)
    chosen = None if laws is None else tuple(laws)
    found = evaluate(records, bounds, so_far, laws=chosen, sizes=sizes, gain_error=gain, name=name)
    spec = specimen_of(found, bounds, name=name, title=f"characterised on the rig {on.name}")
    outcome = Characterisation(on.name, bounds, done, found, spec, records, _cautions(found), folder)
    if folder is not None:
        found.points.save(folder / POINTS)
        write_text(folder / "result.json", json.dumps(outcome.to_dict(), indent=1) + "\n", field="out")
        if outcome.passed:
            outcome.save(folder / f"{name}.toml")
        else:
            (folder / f"{name}.toml").unlink(missing_ok=True)
        outcome.report(folder / REPORT)
    return outcome


def mounted_muscle(
    rig: Any, muscle: Any, rest_length: Any, hardware: Hardware | None, machine: str | None, *, lock_step: bool
) -> tuple[Rig, MuscleUnit | None, float]:
    """The rig, the muscle of a simulated one, and the length at which it is mounted [m]."""
    if lock_step and machine is None:
        raise InputError("lock_step", None, "is allowed only with {machine}, for a simulated device")
    check_connection(machine)
    if (muscle is None) == (hardware is None and machine is None):
        problem = "is missing: the muscle of the simulated rig" if muscle is None else "is of a simulated rig"
        raise InputError("muscle", None, problem)
    unit = None if muscle is None else rig_unit(muscle)
    own = None if unit is None else _rest_of(muscle, unit)
    rest = own if rest_length is None else float(in_si(rest_length, "m", field="rest_length"))
    if rest is None:
        raise InputError("rest_length", None, "is missing: the span at which the muscle is mounted")
    if own is not None and abs(rest / own - 1.0) > MOST_MISREAD:
        problem = f"must be about {with_unit(own, 'm')}, that of the simulated muscle; simulate one that is cut to it"
        raise InputError("rest_length", with_unit(rest, "m"), problem)
    return rig if isinstance(rig, Rig) else rig_of(rig), unit, rest


def recorded_stages(
    machine: _Machine,
    intended: CharacterisationPlan,
    bounds: Bounds,
    known: Progression,
    folder: Path | None,
    progress: Progress | None,
    stop: Callable[[], bool] | None,
) -> tuple[Progression, dict[str, Recording], tuple[StageRecord, ...]]:
    """What the stages found, and their recordings: those in the folder, and of the machine what is not there."""
    records, done, passed = {}, [], 0.0
    for stage in intended.seconds:
        place = None if folder is None else place_of(folder, stage)
        resumed = place is not None and place.exists()
        if resumed and place is not None:
            record = read_recording(place)
        else:

            def tell(time: float, _: float, stage: str = stage, before: float = passed) -> None:
                if progress is not None:
                    progress(before + time, intended.total, stage)

            record = machine.run(stage, protocol_of(stage, bounds, known), tell, stop)
        try:
            check_whole(stage, record, machine.rig, bounds)
            known = advance(stage, record, bounds, known)
        except StageError as error:
            if folder is None or resumed or (stop is not None and stop()):
                raise
            raise StageError(stage, f"{error.problem}. Written: {record.save(_failed(folder, stage))}") from None
        if place is not None and not resumed:
            record.save(place)
            _failed(place.parent, stage).unlink(missing_ok=True)
        records[stage] = record
        seconds = float(max(step["end"] for step in record.meta["steps"]))
        done.append(StageRecord(stage, seconds, resumed))
        passed += intended.seconds[stage]
    return known, records, tuple(done)


def _cautions(found: Evaluation) -> tuple[Caution, ...]:
    best = found.fits[0]
    said = [*best.warnings, *(f"friction: {warning}" for warning in found.friction.warnings)]
    if not best.build().has_volume():
        said.append(
            "these tensions are those of no ideal braid, so that the volume is not known, which commands that fill the "
            f"muscle need; measure it, and state rest_volume under laws.{best.law} in the specimen's file"
        )
    return collect(*map(Caution, said), *map(Caution, assumptions([best])))


def holder_of(rig: Rig, unit: MuscleUnit | None, cord: float | str | None) -> Tendon | None:
    """What holds the muscle: as stated, or cord and frame of a simulated rig in series; None where it is not known."""
    if cord is not None:
        stiffness = float(in_si(cord, "N/m", field="cord"))
        if not stiffness > 0.0:
            raise InputError("cord", with_unit(stiffness, "N/m"), "must be above 0 N/m")
        return Tendon(stiffness=stiffness, toe_length=LEAST_TOE)
    if unit is None:
        return None
    frame = float(rig.frame.stiffness)
    if unit.tendon is None:
        return Tendon(stiffness=frame, toe_length=LEAST_TOE)
    both = 1.0 / (1.0 / frame + 1.0 / float(unit.tendon.stiffness))
    return Tendon(stiffness=both, toe_length=unit.tendon.toe_length)


class _Machine:
    """The machine on which the stages are run, a simulated one with its muscle or a real one in a session."""

    def __init__(
        self, rig: Rig, layout: str, unit: MuscleUnit | None, bounds: Bounds, session: Session, seed: int, step: float
    ) -> None:
        self.rig, self.layout, self.unit, self.session, self.seed, self.step = rig, layout, unit, session, seed, step
        self.stand_in = stand_in_muscle(bounds.rest_length)

    def prepared(self, stage: str, protocol: Protocol) -> PreparedRun:
        """Dry run of a stage, which knows nothing of the muscle but its rest length."""
        # the tension of an unknown muscle is not foreseen; the load cell's interlock and the tests of the steps watch it
        if self.unit is None:
            return prepare_on_machine(protocol, self.session.setup.rate, foresee=False, **self.session.setup.options)
        seed = self.seed * len(STAGES) + _NUMBERED.index(stage)
        made = prepare(
            protocol, muscle=self.stand_in, rig=self.rig, plumbing=self.layout, seed=seed, step=self.step, foresee=False
        )
        return dataclasses.replace(made, unit=self.unit, specimen=None)

    def run(
        self, stage: str, protocol: Protocol, progress: Callable[[float, float], None], stop: Callable[[], bool] | None
    ) -> Recording:
        """Run a stage; keeps the channels that a real machine has."""
        prepared = self.prepared(stage, protocol)
        try:
            record = self.session.run(prepared, new_machine=self.unit is not None, progress=progress, stop=stop)
        except EmptyRunError as error:
            raise StageError(stage, str(error)) from None
        return record.pick([*record.names("measured"), *record.names("command")])


@contextlib.contextmanager
def machine_for(
    rig: Rig, layout: str, unit: MuscleUnit | None, bounds: Bounds, hardware: Hardware | None, seed: int, step: float
) -> Iterator[_Machine]:
    """The machine, closed at the end; a real one is vented."""
    stand_in = stand_in_muscle(bounds.rest_length)
    session = Session(
        rig, stand_in if unit is None else unit, hardware, span=bounds.rest_length, plumbing=layout,
        by_hand=hardware is not None, speed=None if hardware is None else 1.0,
    )  # fmt: skip
    try:
        yield _Machine(rig, layout, unit, bounds, session, seed, step)
    finally:
        if hardware is not None:
            session.close()


def stand_in_muscle(rest_length: float) -> MuscleUnit:
    """A muscle that hardly pulls, in whose place the unknown one is planned."""
    law = build_law(
        "linear_threshold",
        {
            "stiffness_per_pressure": 1e-6,
            "shortest_length": 0.5 * rest_length,
            "threshold_pressure": 0.0,
            "passive_stiffness": 0.0,
            "rest_length": rest_length,
            "upper_length": 1.1 * rest_length,
            "rest_volume": 1e-5,
        },
    )
    return rig_unit(Muscle(law))


def _rest_of(muscle: str | Specimen | Muscle | MuscleUnit | None, unit: MuscleUnit) -> float:
    spec = muscle_specimen(muscle) if isinstance(muscle, str) else muscle
    stated = spec if isinstance(spec, Specimen) else spec.specimen if isinstance(spec, Muscle) else None
    return rest_length_of(stated, unit.law)


def _title_of(muscle: str | Specimen | Muscle | MuscleUnit | None) -> str:
    if muscle is None:
        return "real"
    if isinstance(muscle, str):
        return muscle
    spec = muscle if isinstance(muscle, Specimen) else getattr(muscle, "specimen", None)
    return "own" if spec is None else str(spec.id)


def layout_of(rig: Rig, plumbing: str | None) -> str:
    """The plumbing asked for, else one with a muscle, which can be shut off where there is one."""
    if plumbing is not None:
        if plumbing not in rig.plumbing:
            raise InputError("plumbing", plumbing, known=list(rig.plumbing))
        return plumbing
    usable = [n for n, p in rig.plumbing.items() if p.has_muscle]
    return next((n for n in usable if rig.plumbing[n].shut_off is not None), usable[0])


def recording_folder(out: str | os.PathLike[str], settings: dict[str, JsonValue]) -> Path:
    """Make the folder of the recordings, or take one whose recordings were made with the same settings.

    Raises:
        InputError: it has recordings that were made with other settings.
    """
    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise InputError("out", str(folder), "must be a folder")
    folder.mkdir(parents=True, exist_ok=True)
    place = folder / SETTINGS
    if place.exists():
        stored = parse_json(read_text(place, field="out", form="JSON"))
        if not isinstance(stored, dict):
            raise InputError("out", str(place), "must be the settings of a characterisation")
        recorded = any(place_of(folder, stage).exists() for stage in STAGES | OTHER_STAGES)
        for key in {**settings, **stored} if recorded else ():
            before, value = stored.get(key), settings.get(key)
            if before == value or (key in CONTENTS and before is None):
                continue
            if key in CONTENTS:
                which = f"the {CONTENTS[key]} has changed since its stages were recorded"
            else:
                which = f"its {key} is {_shown(key, before)}, not {_shown(key, value)}"
            said = f"{folder} has stages of another characterisation: {which}; use another folder"
            raise InputError("out", str(folder), "is of another one", sentence=said)
    write_text(place, json.dumps(settings, indent=1) + "\n", field="out")
    return folder


def place_of(folder: Path, stage: str) -> Path:
    """Return the file of a stage's recording in a folder."""
    return folder / f"{1 + _NUMBERED.index(stage)}-{stage}.nc"


def _failed(folder: Path, stage: str) -> Path:
    return folder / f"failed-{stage}.nc"


def _shown(key: str, value: JsonValue) -> str:
    unit = {"rest_length": "m", "max_pressure": "Pa", "max_tension": "N"}.get(key)
    if value is None:
        return "none"
    return with_unit(float(value), unit) if unit and isinstance(value, int | float) else repr(value)


def settings_of(
    rig: Rig, layout: str, bounds: Bounds, seed: int, muscle: str | Specimen | Muscle | MuscleUnit | None
) -> dict[str, JsonValue]:
    """Return what recordings are made with [SI], with digests of what the rig and the muscle are.

    Args:
        rig: the rig.
        layout: name of its plumbing.
        bounds: of the characterisation.
        seed: of the simulated sensors' noise.
        muscle: of a simulated rig; None on a real machine.
    """
    spec: object = muscle_specimen(muscle) if isinstance(muscle, str) else muscle
    if isinstance(muscle, Muscle):  # whose law may be another than that of its specimen
        spec = None if muscle.specimen is None else muscle.stated_specimen()
    return {
        "rig": rig.name,
        "rig_digest": _digest(rig.document),
        "plumbing": layout,
        "muscle": _title_of(muscle),
        "muscle_digest": _digest(spec.stated()) if isinstance(spec, Specimen) else "",
        "seed": seed,
        "rest_length": bounds.rest_length,
        "max_pressure": bounds.pressure,
        "max_tension": bounds.tension,
    }


def make_settings(spec: Specimen, *, same_rig: bool) -> dict[str, JsonValue]:
    """Return where readings of a muscle of a make follow from: the specimen of the make, and whether it is of this rig."""
    return {"make": spec.id, "make_digest": _digest(spec.stated()), "same_rig": same_rig}


def _digest(content: object) -> str:
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def check_whole(stage: str, record: Recording, rig: Rig, bounds: Bounds) -> None:
    """Refuse a recording that was stopped or whose sensors saturate."""
    result = record.meta.get("result", "done")
    if result != "done":
        said = str(record.meta.get("message") or result)
        if float(np.max(record["tension"])) > float(rig.interlocks.most_tension):
            least = with_unit(LESS * bounds.tension, "N", 2)
            said += f"; begin anew with a largest tension (max_tension) of {least} or less, and another folder"
        raise StageError(stage, said)
    for name in ("tension", "pressure"):
        converter = rig.sensors[name].converter
        top = min(float(converter.top) - SATURATED * float(converter.resolution), float(rig.sensors[name].high))
        largest = float(np.max(record[name]))
        if largest >= top:
            unit = "N" if name == "tension" else "Pa"
            raise StageError(stage, f"the sensor of the {name} saturates at {with_unit(largest, unit, 4)}")
