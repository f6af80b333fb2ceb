"""Two shorter questions to a rig: one muscle of a known make by two readings, and what holds a muscle by a rod in its place.

Both take minutes. The readings are at the places that `next_measurement` names; they condition how far muscles of the make
differ, see `identification.between`. The rod hardly stretches, so that what the span grows by under tension is the cord's
and the frame's; the muscle's own length in a characterisation is the span less that.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ... import verbs
from ...answers import Answer, Caution, Column, Table
from ...assembly.build import rig_unit
from ...bench.hardware.backends import connected
from ...bench.hardware.interface import Hardware
from ...bench.rig import Rig
from ...bench.rig_file import rig as rig_of
from ...bench.session.interface import session_rate
from ...documents import JsonValue, write_text
from ...engine import STEP
from ...errors import InputError, StageError
from ...estimation import NORMAL_QUANTILE, Estimate, descend, uncertainty
from ...identification.between import NewMuscle, TensionReading
from ...identification.calibration import calibrate_muscle
from ...muscles import Muscle
from ...muscles.elements import Tendon
from ...muscles.muscle import built_muscle
from ...quantities import in_si, with_unit
from ...recordings import Recording
from ...specimens import Specimen, muscle_specimen, save_specimen
from ..next_measurement import NextReadings, readings_to_take
from .evaluation import of_muscle, part_of
from .stages import MOST_PULLED, Progression, protocol_of
from .verb import (
    CharacterisationPlan,
    Progress,
    bounds_of,
    check_whole,
    holder_of,
    layout_of,
    machine_for,
    make_settings,
    mounted_muscle,
    recorded_stages,
    recording_folder,
    settings_of,
    stage_times,
    stand_in_muscle,
)

# Standard uncertainty of a stiffness by the load cell's gain and what the rod itself stretches, a share.
PULL_ERROR = 5e-3
ROD_STIFFNESS = 1e12  # of the rod that stands in for the muscle of a simulated rig, over its stretch [N/m^2]
LEAST_TENSION = 10.0  # to which a rod has to be pulled, and in noise of the cell [N]
MOST_LEFT = 0.02  # rms of the tension that a cord leaves, of the largest, beyond which it is none


@dataclass(frozen=True)
class ReadCharacterisation(Answer):
    """One muscle of a make, known by readings on a rig: what `characterise_like` finds.

    Attributes:
        rig: name of the rig.
        like: id of the specimen of its make.
        muscle: calibrated, whose specimen states the readings and the interval that they leave.
        new: Gaussian of its tension.
        before: mean half width of the 95 % interval without the readings, as a share of the largest tension.
        planned: places of the readings, with the tensions that were expected.
        seconds: machine time [s].
        records: recordings of the stages.
        cautions: what must be known of the readings.
        folder: of recordings, result and specimen; None where nothing was written.
    """

    rig: str
    like: str
    muscle: Muscle
    new: NewMuscle
    before: float
    planned: NextReadings
    seconds: float
    records: Mapping[str, Recording]
    cautions: tuple[Caution, ...] = ()
    folder: Path | None = None

    @property
    def file_name(self) -> str:
        """Name of the specimen's file in the folder."""
        assert self.muscle.specimen is not None
        return f"{self.muscle.specimen.id}.toml"

    @property
    def readings(self) -> tuple[TensionReading, ...]:
        """As they were taken: length of the muscle itself, pressure and tension."""
        return self.new.readings

    @property
    def after(self) -> float:
        """Mean half width of the 95 % interval after the readings, as a share of the largest tension."""
        return self.new.share()

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per reading, with the tension that was expected of the make [SI]."""
        places = zip(self.readings, self.planned.places, strict=True)
        return [{**read._asdict(), **{k: place[k] for k in ("low", "high")}} for read, place in places]

    def column_units(self) -> Mapping[str, str]:
        """SI units of the columns of `rows`."""
        return {"length": "m", "pressure": "Pa", "tension": "N", "low": "N", "high": "N"}

    def to_dict(self) -> dict[str, JsonValue]:
        """Readings, parameters and half widths [SI]."""
        return {
            "rig": self.rig,
            "like": self.like,
            "law": self.muscle.law_name,
            "parameters": dict(self.new.calibrated()),
            "half_width": {"before": self.before, "after": self.after},
            "machine_time": self.seconds,
            **self.new.to_dict(),
        }

    def tables(self) -> list[Table]:
        """The readings beside what was expected of the make."""
        names = {"length": "", "pressure": "", "tension": "read", "low": "expected: from", "high": "to"}
        units = self.column_units()
        columns = tuple(Column(key, title or None, units[key], beside=True) for key, title in names.items())
        after, before = 100.0 * self.after, 100.0 * self.before
        note = f"The tension is known to {after:.1f} % of the largest (95 %), without readings to {before:.1f} %."
        return [Table(f"Readings of a muscle like {self.like}", columns, self.rows(), (note,))]

    def remarks(self) -> list[str]:
        """Where a further reading is best taken, how long these took, and where the specimen is."""
        said = [f"A further reading: {self.new.next_reading()}.", f"{self.seconds / 60.0:.1f} min of machine time."]
        return said + ([] if self.folder is None else [f"Written: {self.folder / self.file_name}"])

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the calibrated specimen, a ``.toml`` file that every command takes; returns its path."""
        assert self.muscle.specimen is not None
        save_specimen(self.muscle.specimen, path, heading=f"read on the rig {self.rig}, like {self.like}")
        return Path(path)


class CordStiffness(NamedTuple):
    """What holds a muscle: `stiffness` of cord and frame in series [N/m], with its toe, and what it left of the tension.

    Attributes:
        stiffness: with its 95 % interval [N/m]; its text goes to ``cord`` of `characterise`.
        toe: stretch over which it gets stiff [m].
        left: rms of the tension that it leaves, over the largest [1].
        tension: largest tension of the pull [N].
    """

    stiffness: Estimate
    toe: Estimate
    left: float
    tension: float

    @property
    def tendon(self) -> Tendon:
        """As an element."""
        return Tendon(stiffness=self.stiffness.value, toe_length=self.toe.value)

    def __str__(self) -> str:
        value, low, high = (with_unit(one, "N/m", 4) for one in self.stiffness[:3])
        return f"cord and frame: {value} (95 %: {low} to {high}) up to {with_unit(self.tension, 'N', 3)}"


@verbs.verb
def characterise_like(
    like: verbs.MuscleName,
    rig: verbs.RigName = "modern",
    *,
    muscle: verbs.MuscleName | None = None,
    rest_length: verbs.Length | None = None,
    same_rig: bool = False,
    plumbing: verbs.PlumbingName | None = None,
    max_pressure: verbs.Pressure | None = None,
    max_tension: verbs.Force | None = None,
    cord: verbs.Stiffness | None = None,
    seed: verbs.Seed = 0,
    machine: verbs.MachineName | None = None,
    lock_step: bool = False,
    out: verbs.ResultFolder | None = None,
    hardware: Hardware | None = None,
    step: float = 5e-5,
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
    begun: Callable[[CharacterisationPlan], contextlib.AbstractContextManager[object]] | None = None,
) -> ReadCharacterisation:
    """Read one muscle of a known make on a rig, in two minutes, and calibrate the specimen of the make by it.

    The muscle is found taut, filled at its rest length and shortened, as `next_measurement` says, and read.

    Args:
        like: read a muscle of a known make in two minutes instead, and calibrate the specimen of the make by it; one that
            states how far its muscles differ, such as festo-10mm.
        rig: as of `characterise`, and all that follows but `same_rig`.
        muscle: muscle of a simulated rig; None on a real machine.
        rest_length: of the muscle, where it is mounted, as text or [m]; that of a simulated muscle by default.
        same_rig: the rig is the one on which the make was measured, so that the muscle differs less from it.
        plumbing: how the pneumatic parts are joined.
        max_pressure: highest gauge pressure, as text or [Pa].
        max_tension: largest tension, as text or [N].
        cord: stiffness of cord and frame in series, as text or [N/m], as `measure_cord` finds it.
        seed: random seed for sensor noise.
        machine: run on a real machine.
        lock_step: let a simulated device wait for every command.
        out: folder of recordings, result and specimen; the same question resumes from it.
        hardware: a real machine, with the muscle mounted at the rest length; it stays open.
        step: largest step of the simulated physics [s].
        progress: told the machine time done and planned [s], and the stage.
        stop: asked whether to end; the machine is vented then.
        begun: told what is planned, before anything moves; its context is open while the machine moves.

    Raises:
        InputError: an argument is out of its range, or the specimen does not state how far muscles of its make differ.
        StageError: a stage could not be finished.

    Examples:
        >>> from mckibben.studies.characterisation import characterise_like
        >>> found = characterise_like("festo-10mm", muscle="festo-10mm", max_tension="450 N")    # doctest: +SKIP
        >>> found.muscle.tension("27 cm", "5 bar")                                             # doctest: +SKIP
    """
    on, unit, rest = mounted_muscle(rig, muscle, rest_length, hardware, machine, lock_step=lock_step)
    spec = like if isinstance(like, Specimen) else muscle_specimen(like)
    layout = layout_of(on, plumbing)
    bounds = bounds_of(on, layout, rest_length=rest, max_pressure=max_pressure, max_tension=max_tension)
    bounds = dataclasses.replace(bounds, cord=holder_of(on, unit, cord))
    of_make: Any = built_muscle(spec, law=spec.law, rest_length=rest)
    places = readings_to_take(of_make, same_rig=same_rig, highest=bounds.pressure)
    most, read_at = max((place["tension"], place["pressure"]) for place in places.places)
    if most > bounds.tension:
        pulls = f"such a muscle pulls {with_unit(most, 'N', 3)} where it is read, at {with_unit(read_at, 'Pa', 3)}"
        problem = f"must be one at which it pulls {with_unit(bounds.tension, 'N', 3)} at most: {pulls}"
        raise InputError("max_pressure", None if max_pressure is None else with_unit(bounds.pressure, "Pa"), problem)
    # spans are longer than the muscle by what a known cord stretches under the tension that is expected
    longer = [0.0 if bounds.cord is None else float(bounds.cord.stretch(p["tension"])) for p in places.places]
    spans = tuple(
        (min(p["length"] + by, MOST_PULLED * rest), p["pressure"]) for p, by in zip(places.places, longer, strict=True)
    )
    known = Progression(places=spans)
    seconds = stage_times(on, layout, bounds, ("seat", "readings"), known)
    intended = CharacterisationPlan(bounds, seconds, places)
    settings = settings_of(on, layout, bounds, seed, muscle) | make_settings(spec, same_rig=same_rig)
    folder = None if out is None else recording_folder(out, settings)
    with (
        contextlib.nullcontext() if begun is None else begun(intended),
        connected(machine, on, 1.0 / session_rate(on), lock_step=lock_step) as opened,
        machine_for(on, layout, unit, bounds, hardware or opened, seed, step) as sampled,
    ):
        known, records, done = recorded_stages(sampled, intended, bounds, known, folder, progress, stop)
    alone = of_muscle(records["readings"], bounds, known.zero)
    readings = []
    for i in range(1, len(spans) + 1):
        part = part_of(alone, f"reading {i}", "readings")
        length, pressure, tension = (float(np.mean(part[name])) for name in ("span", "pressure", "tension"))
        if tension - known.zero <= known.slack:
            low, high = (with_unit(places.places[i - 1][name], "N", 3) for name in ("low", "high"))
            slack = (
                f"the muscle hangs slack at {with_unit(length, 'm', 4)}, where 95 % of the make pull {low} to {high}"
            )
            raise StageError("readings", f"{slack}: check the rest length and the pressure")
        readings.append(TensionReading(length, pressure - known.zero_pressure, tension - known.zero))
    made, new = calibrate_muscle(of_make, readings, same_rig=same_rig)
    time = sum(one.seconds for one in done)
    found = ReadCharacterisation(
        on.name, spec.id, made, new, places.before, places, time, records, new.cautions(), folder
    )
    if folder is not None:
        write_text(folder / "result.json", json.dumps(found.to_dict(), indent=1) + "\n", field="out")
        found.save(folder / found.file_name)
    return found


def measure_cord(
    rig: Rig | str | os.PathLike[str] = "modern",
    *,
    rod_length: float | str = "14 cm",
    plumbing: str | None = None,
    max_tension: float | str | None = None,
    tendon: Tendon | None = None,
    hardware: Hardware | None = None,
    seed: int = 0,
    step: float = STEP,
    stop: Callable[[], bool] | None = None,
) -> CordStiffness:
    """Measure how stiff cord and frame are, by a pull on a rod that hangs in the muscle's place.

    Args:
        rig: the rig, its name or file.
        rod_length: span at which the rod gets taut, as text or [m].
        plumbing: how the pneumatic parts are joined; nothing is filled.
        max_tension: largest tension, as text or [N]; what the rig bears by default.
        tendon: cord of a simulated rig; the usual one by default.
        hardware: a real machine with the rod mounted; it stays open.
        seed: of the simulated sensors' noise.
        step: largest step of the simulated physics [s].
        stop: asked whether to end.

    Raises:
        InputError: an argument is out of its range.
        StageError: the rod was not pulled, or what gave was no cord.

    Examples:
        >>> from mckibben.studies.characterisation import measure_cord
        >>> print(measure_cord("modern"))    # doctest: +SKIP
    """
    on = rig if isinstance(rig, Rig) else rig_of(rig)
    length = float(in_si(rod_length, "m", field="rod_length"))
    bounds = bounds_of(on, layout_of(on, plumbing), rest_length=length, max_tension=max_tension)
    unit = None
    if hardware is None:
        law: Any = stand_in_muscle(length).law
        unit = rig_unit(Muscle(law.replace(upper_length=length, stop_stiffness=ROD_STIFFNESS)))
        unit = unit if tendon is None else unit.replace(tendon=tendon)
    with machine_for(on, layout_of(on, plumbing), unit, bounds, hardware, seed, step) as machine:
        record = machine.run("cord", protocol_of("cord", bounds, Progression()), None, stop)  # type: ignore[arg-type]
    check_whole("cord", record, on, bounds)
    return cord_of(record)


def cord_of(record: Recording) -> CordStiffness:
    """Fit a cord to the pull of a rod: where it gets taut, its toe, and its stiffness beyond.

    Raises:
        StageError: the rod was not pulled, or what gave was no cord.
    """
    still, pull = part_of(record, "zero", "cord"), part_of(record, "pull", "cord")
    zero, noise = float(np.mean(still["tension"])), float(np.std(still["tension"]))
    span, tension = pull["span"], pull["tension"] - zero
    largest = float(tension.max())
    if largest < max(LEAST_TENSION, LEAST_TENSION * noise):
        raise StageError("cord", f"the rod was pulled with {with_unit(largest, 'N', 2)} only; check where it gets taut")
    taut = float(span[np.argmax(tension > 0.1 * largest)])
    slope = 0.9 * largest / max(float(span[np.argmax(tension)]) - taut, 1e-6)
    # stiffness, toe, and where it gets taut, from where the pull has a tenth of it
    size = np.array([slope, 1e-3, 1e-3])

    def residual(scaled: np.ndarray) -> np.ndarray:
        stiffness, toe, begin = scaled * size
        stretch = span - taut - begin
        inside = np.clip(stretch, 0.0, toe)
        pulled = stiffness * (0.5 * inside**2 / toe + np.maximum(stretch - toe, 0.0))
        left: np.ndarray = (pulled - tension) / largest
        return left

    ends = np.array([0.01, 1e-3, -20.0]), np.array([100.0, 20.0, 20.0])
    found = descend(residual, np.array([1.0, 0.5, -0.5]), bounds=ends)
    left = float(np.sqrt(np.mean(found.residual**2)))
    if left > MOST_LEFT:
        share = f"{100.0 * left:.2g} % of the largest tension"
        raise StageError("cord", f"what gives under the rod is no cord: {share} are left; check that nothing slips")
    said = uncertainty(found.jacobian, found.residual, ("stiffness", "toe", "length"))
    error = np.hypot(said.standard_error[0], PULL_ERROR * found.x[0])
    stiffness, toe = (float(v) for v in (found.x * size)[:2])
    half = [NORMAL_QUANTILE * float(e) for e in (error * size[0], said.standard_error[1] * size[1])]
    return CordStiffness(
        Estimate(stiffness, stiffness - half[0], stiffness + half[0], "N/m"),
        Estimate(toe, max(toe - half[1], 0.0), toe + half[1], "m"),
        left,
        largest,
    )
