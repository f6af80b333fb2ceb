"""Records of muscles in motion for the benchmark, and their frozen splits.

A record over time is left out as a whole, with its muscle or its trial, or part of it is hidden: there a model sees the
inputs of all samples, and the outputs of the others. What a model starts from is the first value of each output.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..quantities import to_si
from .datasets import MOUNTINGS, unpacked
from .records import BenchmarkRecord, DataSplit

FILLING, VENTING = "filling", "venting"
DROP = to_si(0.1, "bar", "Pa", field="pressure")  # below what was held: the exhaust is open
HELD = 100  # samples before the exhaust is switched whose median is what was held

# Rest length of each cut, and the lengths at which its runs were made, in the order of `MOUNTINGS` [mm].
LENGTHS = {
    "10cm": (83.0, (83.0, 79.75, 76.5, 73.25)),
    "20cm": (182.0, (182.0, 174.5, 167.0, 159.5)),
    "30cm": (281.0, (281.0, 268.75, 256.5, 244.25)),
}
THIRDS = 3
VENTED = 0.3  # when the robot's program opens all exhausts [s], as in `jumping_robot.toml`


# ---- isometric runs


def isometric_runs(paths: Sequence[Path], dimensions: dict[str, float], pressure_zero: float) -> list[BenchmarkRecord]:
    """Records of pressure in and tension out at constant length, at the rate of the recorder.

    Args:
        paths: of the files, of the runs.
        dimensions: of all muscles but the rest length [SI].
        pressure_zero: what the pressure sensor reads at rest [Pa].
    """
    mm, kpa = to_si(1.0, "mm", "m", field="length"), to_si(1.0, "kPa", "Pa", field="pressure")
    records = []
    for path in paths:
        cut, mounting = path.name.split("_")[1:3]
        rest, lengths = LENGTHS[cut]
        tension, gauge, time, state = np.loadtxt(io.BytesIO(unpacked(path)), delimiter=",").T
        pressure = kpa * gauge - pressure_zero
        length = np.full(len(time), mm * lengths[MOUNTINGS.index(mounting)])
        records.append(
            BenchmarkRecord(
                name=path.name.removesuffix(".csv.gz"),
                muscle=f"{rest:.0f} mm",
                inputs={"length": length, "pressure": pressure},
                outputs={"tension": tension},
                dimensions=dimensions | {"rest_length": mm * rest},
                time=time - time[0],
                initial={"tension": float(tension[0])},
                phase=np.where(np.arange(len(time)) < _exhaust(pressure, state), FILLING, VENTING),
            )
        )
    return records


def _exhaust(pressure: np.ndarray, state: np.ndarray) -> int:
    """First sample of the exhaust: the recorded switch leads the fall of the pressure by some tenths of a second."""
    switched = int(np.argmax(state == 2))
    held = float(np.median(pressure[max(0, switched - HELD) : switched]))
    return switched + int(np.argmax(pressure[switched:] < held - DROP))


# ---- one record, part of which is hidden


def part_hidden(record: BenchmarkRecord, hidden: np.ndarray, name: str) -> DataSplit:
    """A fold that hides the outputs of some samples, bool (n,), and scores their prediction."""
    shown = {key: np.where(hidden, np.nan, values) for key, values in record.outputs.items()}
    return DataSplit(name, (replace(record, outputs=shown),), (record,), (hidden,))


def loop_folds(folder: Path) -> tuple[DataSplit, ...]:
    """Each half of a loop of pressure and stroke from the other; the halves take turns of ten samples."""
    from ..studies.muscle_loops import read_loop

    loop = read_loop(folder)
    record = BenchmarkRecord(
        name="loop",
        muscle="DMSP-10-250",
        inputs={"pressure": loop.pressure},
        outputs={"stroke": loop.stroke},
        time=np.arange(len(loop.pressure), dtype=float),
        initial={"stroke": float(loop.stroke[0])},
        phase=np.where(loop.branch == 1, FILLING, VENTING),
    )
    first = loop.split("blocks")
    return part_hidden(record, ~first, "second half"), part_hidden(record, first, "first half")


def creep_folds(folder: Path) -> tuple[DataSplit, ...]:
    """The second half of each held step from the first."""
    from ..identification.creep_fit import creep_half
    from ..studies.muscle_loops import held_steps

    folds = []
    for name, (time, stroke, pressure) in held_steps(folder).items():
        record = BenchmarkRecord(
            name=name,
            muscle="DMSP-10-250",
            inputs={"pressure": pressure},
            outputs={"stroke": stroke},
            time=time - time[0],
            initial={"stroke": float(stroke[0])},
        )
        folds.append(part_hidden(record, ~creep_half(time), name.replace("_", " ")))
    return tuple(folds)


def antagonist_folds(path: Path) -> tuple[DataSplit, ...]:
    """Each third of a record of two muscles that pull against each other from the two others; a third is one period."""
    from scipy.io import loadmat

    columns = {name: np.ravel(values).astype(float) for name, values in loadmat(path).items() if name[0] != "_"}
    kpa = to_si(1.0, "kPa", "Pa", field="pressure")
    outputs = {
        "displacement": columns["x"],
        "pressure_1": kpa * columns["p1"],
        "pressure_2": kpa * columns["p2"],
    }
    count = len(columns["F"])
    record = BenchmarkRecord(
        name="antagonist",
        muscle="antagonist pair",
        inputs={"force": columns["F"]},
        outputs=outputs,
        time=1e-3 * np.arange(count),
        initial={name: float(values[0]) for name, values in outputs.items()},
    )
    third = np.minimum(np.arange(count) * THIRDS // count, THIRDS - 1)
    return tuple(part_hidden(record, third == k, f"period {k + 1}") for k in range(THIRDS))


# ---- jumping robot


def robot_folds(folders: Sequence[Path]) -> tuple[DataSplit, ...]:
    """Each jump from the three others: pressures of tank and muscles from valve commands and joint angles."""
    from ..studies.jumping_robot import MUSCLES, read_trial

    records = []
    for folder in folders:
        trial = read_trial(folder)
        trial = trial.uniform(trial.period)
        time = trial.time - trial.time[0]
        inputs = {f"{kind}_{m}": trial[f"{kind}_{m}"] for kind in ("open", "angle") for m in MUSCLES}
        outputs = {
            f"{node}.pressure": trial[f"{node}.pressure"] for node in ("tank", *(f"muscle_{m}" for m in MUSCLES))
        }
        records.append(
            BenchmarkRecord(
                name=folder.name,
                muscle="jumping robot",
                inputs=inputs | {"vent": (time >= VENTED).astype(float)},
                outputs=outputs,
                time=time,
                initial={name: float(values[0]) for name, values in outputs.items()},
            )
        )
    return tuple(
        DataSplit(r.name, tuple(o for o in records if o is not r), (r,), (np.ones(len(r), bool),)) for r in records
    )
