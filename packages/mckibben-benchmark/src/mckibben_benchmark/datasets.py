"""Measured data of the benchmark: records and splits, where the data are, how they are read, and what is left out in motion.

Data without a licence that permits it do not ship. They are looked for below the folder of measured data, which the
environment variable ``MCKIBBEN_DATA`` names; a hash of their content shows whether they are the data that the splits were
made for. Compressed files are hashed as what they contain, so that it does not matter who compressed them.

A record over time is left out as a whole, with its muscle or its trial, or part of it is hidden: there a model sees the
inputs of all samples, and the outputs of the others. What a model starts from is the first value of each output.
"""

from __future__ import annotations

import gzip
import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mckibben.errors import InputError, MissingDataError
from mckibben.quantities import to_si
from mckibben.specimens import map_file, specimen

from .validation import AARL, JUMP_TRIALS, LOOP_FOLDER, MARTENS, NO_LICENCE, PLATEAUS, ROBOT_FOLDER, VARIABLE


def _protected(values: np.ndarray) -> np.ndarray:
    """A view that cannot be written to."""
    view = np.asarray(values).view()
    view.setflags(write=False)
    return view


@dataclass(frozen=True)
class BenchmarkRecord:
    """Inputs and outputs of one muscle, or one system, at points or over time.

    Attributes:
        name: of the record.
        muscle: that was measured; what several records share.
        inputs: by name, SI, each (n,).
        outputs: by name, SI, each (n,); empty where a model is to predict them.
        dimensions: of the muscle [SI], such as ``rest_length``.
        time: of the samples [s], (n,); None for static points.
        initial: first value of each output over time, by name; empty for static points.
        phase: in which part of a run each sample lies, such as ``filling``, (n,); None if there is one only.

    Examples:
        >>> import numpy as np
        >>> from mckibben_benchmark import BenchmarkRecord
        >>> inputs = {"length": np.array([0.1, 0.1]), "pressure": np.array([1e5, 2e5])}
        >>> BenchmarkRecord("made up", "A", inputs, {"tension": np.array([10.0, 20.0])}).unseen().outputs
        {}
    """

    name: str
    muscle: str
    inputs: Mapping[str, np.ndarray]
    outputs: Mapping[str, np.ndarray] = field(default_factory=dict)
    dimensions: Mapping[str, float] = field(default_factory=dict)
    time: np.ndarray | None = None
    initial: Mapping[str, float] = field(default_factory=dict)
    phase: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Protect the arrays, so that no model changes what others are scored on."""
        for name in ("inputs", "outputs"):
            object.__setattr__(self, name, {key: _protected(values) for key, values in getattr(self, name).items()})
        for name in ("time", "phase"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _protected(getattr(self, name)))

    def __getattr__(self, name: str) -> object:
        """Say what a record has where a model asks for something else."""
        known = [
            f"{group}[{key!r}]" for group in ("inputs", "outputs", "dimensions") for key in vars(self).get(group, ())
        ]
        raise AttributeError(
            f"BenchmarkRecord has no attribute {name!r}; this record has {', '.join(known)}, time and initial"
        )

    def __len__(self) -> int:
        return len(next(iter(self.inputs.values())))

    @property
    def is_static(self) -> bool:
        """Whether the samples are points without an order in time."""
        return self.time is None

    def unseen(self) -> BenchmarkRecord:
        """The record without its outputs, as a model sees it that has to predict them."""
        return replace(self, outputs={})

    def select(self, keep: np.ndarray) -> BenchmarkRecord:
        """The samples where `keep` is true, bool (n,)."""
        return replace(
            self,
            inputs={name: values[keep] for name, values in self.inputs.items()},
            outputs={name: values[keep] for name, values in self.outputs.items()},
            time=None if self.time is None else self.time[keep],
            phase=None if self.phase is None else self.phase[keep],
        )

    def every(self, step: int) -> BenchmarkRecord:
        """Every `step`-th sample, from the first."""
        return self.select(np.arange(len(self)) % step == 0)

    def features(self) -> np.ndarray:
        """Inputs in the order of their names, then the rest length if it is known, as columns (n, features)."""
        columns = [self.inputs[name] for name in sorted(self.inputs)]
        if "rest_length" in self.dimensions:
            columns.append(np.full(len(self), self.dimensions["rest_length"]))
        return np.stack(columns, axis=1)


@dataclass(frozen=True)
class DataSplit:
    """A frozen split: what a model may see, and what it has to predict.

    Attributes:
        name: what is left out, such as ``DMSP-10-250, 3 bar``.
        train: records with outputs.
        test: records with outputs, which the model gets `unseen`.
        scored: which samples of each test record count, bool (n,) each; a model may see the inputs of the others.
    """

    name: str
    train: tuple[BenchmarkRecord, ...]
    test: tuple[BenchmarkRecord, ...]
    scored: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        """Refuse a fold without data."""
        if not self.train or not self.test or len(self.test) != len(self.scored):
            raise InputError("fold", self.name, "must have records to train on, and a mask for each to predict")


# ---- files


# Isometric runs of 10 mm muscles: cut lengths, mountings from stretched to slack, and runs.
CUTS = ("10cm", "20cm", "30cm")
MOUNTINGS = ("Unkink", "kinked25", "kinked50", "kinked75")
RUN_NAMES = ("Test8", "Test9", "Test10")
# Tables of each jump of a robot.
JUMP_TABLES = ("pres_filt.txt", "t_valve.txt", "angle_pre.txt", "vid_time.txt")
LARGEST = 64 << 20  # of a file, unpacked [B]


@dataclass(frozen=True)
class BenchmarkData:
    """Files of measured data.

    Attributes:
        files: below the folder of measured data, or of a specimen's map that ships.
        digest: SHA-256 of the lines "name hash" of all files, unpacked.
        source: who measured them.
        licence: in words.
        ships_with: specimen whose force map the data are; empty if they do not ship.
    """

    files: tuple[str, ...]
    digest: str
    source: str
    licence: str
    ships_with: str = ""

    def locate(self, folder: Path | None) -> tuple[Path, ...]:
        """Find the files and check their content.

        Raises:
            MissingDataError: a file is not there; the sentence names it and where it was looked for.
            InputError: the content is not that for which the tasks were made.
        """
        if self.ships_with:
            paths: tuple[Path, ...] = (map_file(specimen(self.ships_with)),)
        elif folder is None:
            raise MissingDataError(f"{self.files[0]} does not ship; {VARIABLE} names the folder of measured data")
        else:
            paths = tuple(folder / name for name in self.files)
        for path in paths:
            if not path.is_file():
                raise MissingDataError(
                    f"{path} is not there; it does not ship ({self.source}; licence: {self.licence})"
                )
        whole = hashlib.sha256()
        for name, path in zip(self.files, paths, strict=True):
            one = hashlib.sha256(unpacked(path)).hexdigest()
            whole.update(f"{name.removesuffix('.gz')} {one}\n".encode())
        digest = whole.hexdigest()
        if digest != self.digest:
            said = f"{paths[0].parent}: the content has the hash {digest[:12]}, must be {self.digest[:12]}"
            raise InputError("data", str(paths[0].parent), "must be unchanged", sentence=said)
        return paths


def unpacked(path: Path) -> bytes:
    """Content of a file, without its gzip compression.

    Raises:
        InputError: the file is larger than any of these data.
    """
    opened = gzip.open(path) if path.suffix == ".gz" else path.open("rb")
    with opened as stream:
        content = stream.read(LARGEST + 1)
    if len(content) > LARGEST:
        raise InputError("file", str(path), f"must be at most {LARGEST >> 20} MB")
    return bytes(content)


DMSP_10 = BenchmarkData(
    files=("martens_boblan_2017/DMSP-10-250_force_map.csv",),
    digest="b08c755b1db167f3eeaf44ae8af47ce39c2ceb50de62e2df35c24fab1bb1d2f7",
    source=MARTENS,
    licence="CC BY 4.0; ships",
    ships_with="DMSP-10-250",
)
DMSP_20 = BenchmarkData(
    files=("martens_boblan_2017/DMSP-20-300_force_map.csv",),
    digest="d5a4c798f3690819930dd2cf0a32bbca967f0f3b6e97954ac63e31a065d0a4e9",
    source=MARTENS,
    licence="CC BY 4.0; ships",
    ships_with="DMSP-20-300",
)
SHEET = BenchmarkData(
    files=("festo_datasheet/DMSP-20_force_contraction.csv",),
    digest="35b41a409bf63bf76a1ffa998f198c958b61bb80f59ba190b5259d59a18267bc",
    source="data sheet of the maker, read off by hand",
    licence=NO_LICENCE,
)
PLATEAU = BenchmarkData(
    files=(PLATEAUS,),
    digest="b98518ecd21ae5154f0628f774c01129df23a8bf501e87071fd1dfd9353981a0",
    source=AARL,
    licence=NO_LICENCE,
)
RUNS = BenchmarkData(
    files=tuple(
        f"aarl_10mm_isometric/10mm_{cut}_{mounting}_{run}.csv.gz"
        for cut in CUTS
        for mounting in MOUNTINGS
        for run in RUN_NAMES
    ),
    digest="ed930cdfbf5c87025bf55337b3167ac3fb9960dfffd7577c9f9ece1da5ca62f4",
    source=AARL,
    licence=NO_LICENCE,
)
PLATEAU_20 = BenchmarkData(
    files=("aarl_20mm_isometric/quasistatic_plateaus.csv",),
    digest="5433677a8e5c96e0f60ac8d8c08b0cce2e870920933e4a22c5d8716b82def5ae",
    source=AARL,
    licence=NO_LICENCE,
)
LOOP = BenchmarkData(
    files=tuple(f"{LOOP_FOLDER}/{name}" for name in ("pressure_stroke_loop.csv", "step_response_100hz.csv")),
    digest="3687a5161433f9dff5eb2340be196101b84b6f2cc07b1945bb3710e0d675651b",
    source="public repository tbazina/pam_lqi_pid",
    licence=NO_LICENCE,
)
HOLDS = BenchmarkData(
    files=("dmsp_10_250_holds/random_holds.csv",),
    digest="b20a54194c19d277e0d85aeaffc06dd56fc1887cd9c71568feb5906be1014581",
    source=LOOP.source,
    licence=NO_LICENCE,
)
JUMPS = BenchmarkData(
    files=tuple(f"{ROBOT_FOLDER}/{jump}/{table}" for jump in JUMP_TRIALS for table in JUMP_TABLES),
    digest="ad127217b62ee927cd541ec785043903f833f7d3670e8db2dfec78bdcf7a63e4",
    source="public repository borglab/GTDynamics, Georgia Tech Research Corp.",
    licence="BSD-style: read, not copied",
)
ANTAGONIST = BenchmarkData(
    files=("pneu_sim_antagonist/data.mat",),
    digest="479d7eb51187efad5ca368c62a3d0eb30104203d7b2f5595cc2be37b1b477d7d",
    source="public repository jonreal/pneu-sim",
    licence="Apache-2.0; does not ship",
)


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
    from .muscle_loops import read_loop

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


HOLD = 4.0  # of each pressure [s]


def hold_folds(path: Path) -> tuple[DataSplit, ...]:
    """The second half of random holds of a pressure from the first; the muscle at rest, without stroke, comes before."""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    bar, mm = to_si(1.0, "bar", "Pa", field="pressure"), to_si(1.0, "mm", "m", field="stroke")
    pressure, stroke = np.insert(bar * table[:, 1], 0, 0.0), np.insert(mm * table[:, 2], 0, 0.0)
    count = len(pressure)
    record = BenchmarkRecord(
        name="holds",
        muscle="DMSP-10-250",
        inputs={"pressure": pressure},
        outputs={"stroke": stroke},
        time=HOLD * np.arange(count),
        initial={"stroke": 0.0},
        phase=np.where(np.diff(pressure, prepend=0.0) >= 0.0, FILLING, VENTING),
    )
    return (part_hidden(record, np.arange(count) > (count - 1) // 2 + 1, "second half"),)


def creep_folds(folder: Path) -> tuple[DataSplit, ...]:
    """The second half of each held step from the first."""
    from mckibben.identification.creep_fit import creep_half

    from .muscle_loops import held_steps

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
    outputs = {"displacement": columns["x"], "pressure_1": kpa * columns["p1"], "pressure_2": kpa * columns["p2"]}
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
    from .jumping_robot import MUSCLES, read_trial

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
