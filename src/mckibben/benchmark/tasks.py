"""Tasks of the benchmark: frozen splits of measured data, and what is scored.

A split is a function of the data alone, so that it cannot be chosen anew; the data are checked by their hashes. What a
model is shown of a record that it has to predict are its inputs, the dimensions of the muscle and, over time, the first
value of each output.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..quantities import to_si
from ..recordings import ForceMap, read_force_map
from ..specimens import specimen
from ..studies.jumping_robot import MUSCLES, read_trial
from ..studies.muscle_loops import HELD_FROM, read_loop, read_steps
from ..studies.validation import AARL_ZERO, TRAINED_BELOW
from . import datasets
from .datasets import BenchmarkData
from .records import BenchmarkRecord, Fold

FILLING, VENTING = "filling", "venting"
PAIR_TRAINED = 0.6  # share of the antagonist's record, from its beginning
PAIR_STEP = 5  # every fifth sample of it: 200 Hz, for a motion of 0.1 Hz
LARGEST, RANGE = "largest", "range"


@dataclass(frozen=True)
class Task:
    """A task of the benchmark.

    Attributes:
        name: by which it is addressed.
        title: in tables and headings.
        predicts: what is predicted from what.
        split: what is left out.
        data: the files, with their hashes, source and licence.
        make: makes the folds of the located files.
        scale: to what errors relate: the ``largest`` value of an output of the muscle, or its ``range``.
        note: what a reader of the figures must know.
    """

    name: str
    title: str
    predicts: str
    split: str
    data: tuple[BenchmarkData, ...]
    make: Callable[[Sequence[tuple[Path, ...]]], tuple[Fold, ...]]
    scale: str = LARGEST
    note: str = ""

    @property
    def ships(self) -> bool:
        """Whether all data of the task ship with the package."""
        return all(one.ships_with for one in self.data)

    def load(self, folder: str | Path | None = None) -> tuple[Fold, ...]:
        """Read the data and split them.

        Args:
            folder: of measured data; None if only what ships may be used.

        Raises:
            MissingDataError: data are not there; the sentence says where they are from and under which licence.
            InputError: a file has another content than that for which the split was made.
        """
        place = None if folder is None else Path(folder)
        return self.make([one.locate(place) for one in self.data])


# ---- static maps


def _static_record(points: ForceMap, muscle: str, dimensions: dict[str, float]) -> BenchmarkRecord:
    """Static points as a record; slack points keep the tension that was measured."""
    branch = points.branch
    phase = None if branch is None else np.where(branch == "deflate", VENTING, FILLING)
    return BenchmarkRecord(
        name=muscle,
        muscle=muscle,
        inputs={"length": points.length, "pressure": points.pressure},
        outputs={"tension": points.tension},
        dimensions=dimensions,
        phase=phase,
    )


def _dimensions(name: str) -> dict[str, float]:
    spec = specimen(name)
    return {
        "rest_length": spec.property_si("rest_length", "m"),
        "rest_diameter": spec.property_si("rest_inner_diameter", "m"),
        "wall_thickness": spec.property_si("wall_thickness", "m"),
    }


def _table(path: Path, name: str) -> BenchmarkRecord:
    """The static points of a muscle like a specimen of the package."""
    known = _dimensions(name)
    return _static_record(read_force_map(path, rest_length=known["rest_length"]), name, known)


def _maps(located: Sequence[tuple[Path, ...]]) -> list[BenchmarkRecord]:
    return [_table(paths[0], name) for paths, name in zip(located, ("DMSP-10-250", "DMSP-20-300"), strict=True)]


def _left_out(record: BenchmarkRecord, out: np.ndarray, name: str) -> Fold:
    """A fold that leaves points of one muscle out; of these, those with tension are scored."""
    test = record.select(out)
    return Fold(name, (record.select(~out),), (test,), (test.outputs["tension"] > 0.0,))


def _each_value_out(record: BenchmarkRecord, quantity: str, unit: float, text: str) -> list[Fold]:
    """A fold for each value of an input at which tension was measured."""
    values = record.inputs[quantity]
    taut = record.outputs["tension"] > 0.0
    return [
        _left_out(record, values == value, f"{record.muscle}, {value / unit:.4g} {text}")
        for value in np.unique(values[taut])
    ]


def _pressure_out(located: Sequence[tuple[Path, ...]]) -> tuple[Fold, ...]:
    bar = to_si(1.0, "bar", "Pa", field="pressure")
    return tuple(fold for record in _maps(located) for fold in _each_value_out(record, "pressure", bar, "bar"))


def _length_out(located: Sequence[tuple[Path, ...]]) -> tuple[Fold, ...]:
    return tuple(fold for record in _maps(located) for fold in _each_value_out(record, "length", 1e-3, "mm"))


def _above(located: Sequence[tuple[Path, ...]]) -> tuple[Fold, ...]:
    return tuple(
        _left_out(record, record.inputs["pressure"] > TRAINED_BELOW, record.muscle) for record in _maps(located)
    )


def _sheet(located: Sequence[tuple[Path, ...]]) -> tuple[Fold, ...]:
    record = replace(_table(located[0][0], "DMSP-20-300"), name="DMSP-20 sheet", muscle="DMSP-20 sheet")
    return tuple(_each_value_out(record, "pressure", to_si(1.0, "bar", "Pa", field="pressure"), "bar"))


# ---- muscles of other lengths


def _ten_millimetres(rest: float) -> dict[str, float]:
    return _dimensions("DMSP-10-250") | {"rest_length": rest}


def _plateaus(located: Sequence[tuple[Path, ...]]) -> tuple[Fold, ...]:
    points = read_force_map(located[0][0], pressure_zero=AARL_ZERO)
    rests = np.zeros(0) if points.rest_length is None else points.rest_length
    records = [
        _static_record(points.select(rests == rest), f"{1e3 * rest:.0f} mm", _ten_millimetres(float(rest)))
        for rest in np.unique(rests)
    ]
    return _muscle_out(records, lambda record: record.outputs["tension"] > 0.0)


def _isometric(located: Sequence[tuple[Path, ...]]) -> tuple[Fold, ...]:
    records = []
    for run in datasets.isometric_runs(located[0], pressure_zero=AARL_ZERO):
        records.append(
            BenchmarkRecord(
                name=run.name,
                muscle=f"{1e3 * run.rest_length:.0f} mm",
                inputs={"length": np.full(len(run.time), run.length), "pressure": run.pressure},
                outputs={"tension": run.tension},
                dimensions=_ten_millimetres(run.rest_length),
                time=run.time,
                initial={"tension": float(run.tension[0])},
                phase=np.where(run.venting, VENTING, FILLING),
            )
        )
    return _muscle_out(records, lambda record: np.ones(len(record), bool))


def _muscle_out(
    records: Sequence[BenchmarkRecord], scored: Callable[[BenchmarkRecord], np.ndarray]
) -> tuple[Fold, ...]:
    """A fold for each muscle: all its records are left out."""
    folds = []
    for muscle in dict.fromkeys(record.muscle for record in records):
        train = tuple(record for record in records if record.muscle != muscle)
        test = tuple(record for record in records if record.muscle == muscle)
        folds.append(Fold(muscle, train, test, tuple(scored(record) for record in test)))
    return tuple(folds)


# ---- loop, creep, robot, pair


def _hidden(record: BenchmarkRecord, shown: np.ndarray, name: str) -> Fold:
    """A fold that hides samples of one record: its outputs are NaN there."""
    outputs = {key: np.where(shown, values, np.nan) for key, values in record.outputs.items()}
    return Fold(name, (replace(record, outputs=outputs),), (record,), (~shown,))


def _loop(located: Sequence[tuple[Path, ...]]) -> tuple[Fold, ...]:
    path = read_loop(located[0][0].parent)
    record = BenchmarkRecord(
        name="loop",
        muscle="DMSP-10-250",
        inputs={"pressure": path.pressure},
        outputs={"stroke": path.stroke},
        dimensions=_dimensions("DMSP-10-250"),
        time=np.arange(len(path.pressure), dtype=float),
        initial={"stroke": float(path.stroke[0])},
        phase=np.where(path.branch > 0, FILLING, VENTING),
    )
    train = path.split("blocks")
    return _hidden(record, train, "second half"), _hidden(record, ~train, "first half")


def _creep(located: Sequence[tuple[Path, ...]]) -> tuple[Fold, ...]:
    folds = []
    for segment, (time, stroke, pressure) in read_steps(located[0][0].parent).items():
        held = time >= HELD_FROM[segment] - 1e-6
        time, stroke, pressure = time[held] - time[held][0], stroke[held], pressure[held]
        record = BenchmarkRecord(
            name=segment.replace("_", " "),
            muscle="DMSP-10-250",
            inputs={"pressure": pressure},
            outputs={"stroke": stroke},
            dimensions=_dimensions("DMSP-10-250"),
            time=time,
            initial={"stroke": float(stroke[0])},
        )
        folds.append(_hidden(record, time <= 0.5 * time[-1], record.name))
    return tuple(folds)


def _robot(located: Sequence[tuple[Path, ...]]) -> tuple[Fold, ...]:
    records = []
    for folder in dict.fromkeys(path.parent for path in located[0]):
        trial = read_trial(folder)
        names = ("tank", *(f"muscle_{m}" for m in MUSCLES))
        outputs = {name: np.asarray(trial[f"{name}.pressure"], float) for name in names}
        inputs = {key: np.asarray(trial[key], float) for m in MUSCLES for key in (f"open_{m}", f"angle_{m}")}
        records.append(
            BenchmarkRecord(
                name=folder.name,
                muscle=folder.name,
                inputs=inputs,
                outputs=outputs,
                time=np.asarray(trial.time, float),
                initial={name: float(values[0]) for name, values in outputs.items()},
            )
        )
    return _muscle_out(records, lambda record: np.ones(len(record), bool))


def _pair(located: Sequence[tuple[Path, ...]]) -> tuple[Fold, ...]:
    pair = datasets.pair_record(located[0][0])
    whole = BenchmarkRecord(
        name="pair",
        muscle="pair",
        inputs={"force": pair.force},
        outputs={"displacement": pair.displacement},
        time=pair.time,
        initial={"displacement": float(pair.displacement[0])},
    ).every(PAIR_STEP)
    cut = int(PAIR_TRAINED * len(whole))
    index = np.arange(len(whole))
    return (_hidden(whole, index < cut, f"last {100 * (1 - PAIR_TRAINED):.0f} %"),)


ONE_MUSCLE = (
    "Only one muscle was measured: the interval is over what is left out, and says nothing about other muscles."
)
TWO_MUSCLES = "With two muscles the interval is over what is left out of each, not over muscles."
THREE_MUSCLES = (
    "With three muscles the interval spans little more than the errors of the best and the worst predicted one. The law"
    " `seated_braid` was found on these three muscles, so that its form is no blind prediction here."
)
ON_MAPS = "The exponent and the inactive share of `hyperelastic_braid` were chosen on these two maps."

TASKS: dict[str, Task] = {
    task.name: task
    for task in (
        Task(
            "map-pressure-out",
            "Force maps, a pressure left out",
            "tension from length and pressure",
            "each gauge pressure of a map in turn; trained on the rest of that map",
            (datasets.DMSP_10, datasets.DMSP_20),
            _pressure_out,
            note=f"{TWO_MUSCLES} {ON_MAPS}",
        ),
        Task(
            "map-above-4-bar",
            "Force maps, above 4 bar",
            "tension from length and pressure",
            "all points above 4 bar; trained on those up to 4 bar",
            (datasets.DMSP_10, datasets.DMSP_20),
            _above,
            note=f"{TWO_MUSCLES} {ON_MAPS}",
        ),
        Task(
            "map-length-out",
            "Force maps, a length left out",
            "tension from length and pressure",
            "each length of a map in turn; trained on the rest of that map",
            (datasets.DMSP_10, datasets.DMSP_20),
            _length_out,
            note=f"{TWO_MUSCLES} {ON_MAPS}",
        ),
        Task(
            "data-sheet",
            "Data sheet of a DMSP-20, a pressure left out",
            "tension from length and pressure",
            "each curve of the sheet in turn; trained on the others",
            (datasets.SHEET,),
            _sheet,
            note=ONE_MUSCLE,
        ),
        Task(
            "other-lengths",
            "10 mm muscles of three lengths, one muscle left out",
            "tension from length, pressure and rest length, static",
            "each muscle in turn; trained on the two others",
            (datasets.PLATEAU,),
            _plateaus,
            note=THREE_MUSCLES,
        ),
        Task(
            "transients",
            "The same muscles over time",
            "tension from the measured pressure, at 500 Hz",
            "each muscle in turn, all its twelve runs; trained on the runs of the two others",
            (datasets.ISOMETRIC,),
            _isometric,
            note=THREE_MUSCLES,
        ),
        Task(
            "loop",
            "Pressure-stroke loop of a DMSP-10-250",
            "stroke from the path of the pressure",
            "every other run of ten samples, then the others",
            (datasets.LOOP,),
            _loop,
            scale=RANGE,
            note=ONE_MUSCLE,
        ),
        Task(
            "creep",
            "Creep of a DMSP-10-250 at held pressure",
            "stroke from pressure and time",
            "the second half of each hold; trained on the first",
            (datasets.LOOP,),
            _creep,
            scale=RANGE,
            note=ONE_MUSCLE,
        ),
        Task(
            "robot",
            "Jumping robot",
            "pressures of the tank and of four muscles from valve commands and joint angles",
            "each jump in turn; trained on the three others",
            (datasets.ROBOT,),
            _robot,
            scale=RANGE,
            note="The interval is over the four jumps of one robot.",
        ),
        Task(
            "antagonists",
            "Two muscles against each other",
            "displacement from the force that a motor imposes, valves shut",
            "the last 40 % of 28 s; trained on what comes before",
            (datasets.PAIR,),
            _pair,
            scale=RANGE,
            note=f"{ONE_MUSCLE} The makers of the record low-passed the displacement at 3 Hz, forwards and backwards.",
        ),
    )
}


def task(name: str) -> Task:
    """A task by its name.

    Raises:
        InputError: there is none of that name.
    """
    if name not in TASKS:
        raise InputError("task", name, known=TASKS)
    return TASKS[name]
