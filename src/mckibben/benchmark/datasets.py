"""Measured data of the benchmark: where they are, what they must contain, and how they are read.

Data without a licence that permits it do not ship. They are looked for below the folder of measured data, which the
environment variable ``MCKIBBEN_DATA`` names; a hash of their content tells whether they are the data that the splits were
made for. Compressed files are hashed as what they contain, so that it does not matter who compressed them.
"""

from __future__ import annotations

import gzip
import hashlib
import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError, MissingDataError
from ..quantities import to_si
from ..specimens import map_file, specimen
from ..studies.jumping_robot import ANGLES, FRAMES, PRESSURES, VALVES
from ..studies.validation import AARL, JUMPS, LOOP_FOLDER, MARTENS, NO_LICENCE, PLATEAUS, ROBOT_FOLDER, VARIABLE

LARGEST = 64 << 20  # of a file, unpacked [B]
RUN_FOLDER = Path(PLATEAUS).parent.name


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
        found = content_digest(self.files, paths)
        if found != self.digest:
            said = f"{paths[0].parent}: the content has the hash {found[:12]}, must be {self.digest[:12]}"
            raise InputError("data", str(paths[0].parent), "must be unchanged", sentence=said)
        return paths


def content_digest(names: tuple[str, ...], paths: tuple[Path, ...]) -> str:
    """SHA-256 of the names and contents of files, compressed ones unpacked."""
    whole = hashlib.sha256()
    for name, path in zip(names, paths, strict=True):
        one = hashlib.sha256(unpacked(path)).hexdigest()
        whole.update(f"{name.removesuffix('.gz')} {one}\n".encode())
    return whole.hexdigest()


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


TEST_LENGTHS = ("Unkink", "kinked25", "kinked50", "kinked75")
RUN_KINDS = (8, 9, 10)
# Cut length of a muscle in the names of files [cm] -> rest length and the lengths of the runs [m].
RUN_LENGTHS = {
    10: (0.083, (0.083, 0.07975, 0.0765, 0.07325)),
    20: (0.182, (0.182, 0.1745, 0.167, 0.1595)),
    30: (0.281, (0.281, 0.26875, 0.2565, 0.24425)),
}


def run_name(cut: int, place: str, kind: int) -> str:
    """File of an isometric run below the folder of measured data."""
    return f"{RUN_FOLDER}/10mm_{cut}cm_{place}_Test{kind}.csv.gz"


@dataclass(frozen=True)
class IsometricRun:
    """An isometric run of a 10 mm muscle: time [s], gauge pressure [Pa] and tension [N], each (n,), and its lengths [m].

    `venting` is where the run has been told to exhaust, bool (n,).
    """

    name: str
    rest_length: float
    length: float
    time: np.ndarray
    pressure: np.ndarray
    tension: np.ndarray
    venting: np.ndarray


# From the flag of exhaust to the fall of the pressure [s]; a corrupt flag lasts a few samples, and is no exhaust.
FLAG_LEAD, CORRUPT = 0.4, 50


def isometric_runs(paths: tuple[Path, ...], *, pressure_zero: float) -> list[IsometricRun]:
    """Read the isometric runs, one per file of `ISOMETRIC`, in that order."""
    runs = []
    for name, path in zip(ISOMETRIC.files, paths, strict=True):
        cut, place = name.split("_")[-3:-1]
        rest, lengths = RUN_LENGTHS[int(cut.removesuffix("cm"))]
        table = np.array([line.split(b",") for line in unpacked(path).splitlines()]).astype(float)
        force, pressure, time, flag = table.T
        order = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0.0)  # a repeated time is a corrupt row
        force, pressure, time, flag = (column[order] for column in (force, pressure, time, flag))
        # A branch lasts: a single odd flag does not begin one.
        later = np.flatnonzero(flag == 2.0)
        begins = next(
            (i for i in later if (flag[i : i + CORRUPT] == 2.0).all() and i + CORRUPT <= len(flag)), len(flag)
        )
        venting = time >= (time[begins] + FLAG_LEAD if begins < len(time) else np.inf)
        runs.append(
            IsometricRun(
                name=Path(name).name.removesuffix(".csv.gz").removeprefix("10mm_"),
                rest_length=rest,
                length=lengths[TEST_LENGTHS.index(place)],
                time=time,
                pressure=to_si(1.0, "kPa", "Pa", field="pressure") * pressure - pressure_zero,
                tension=force,
                venting=venting,
            )
        )
    return runs


@dataclass(frozen=True)
class PairRecord:
    """Two muscles against each other: time [s], force [N], displacement [m], pressures [Pa], each (n,)."""

    time: np.ndarray
    force: np.ndarray
    displacement: np.ndarray
    pressures: tuple[np.ndarray, np.ndarray]


def pair_record(path: Path) -> PairRecord:
    """Read the record of the antagonistic pair, sampled at 1 kHz."""
    from scipy.io import loadmat

    table = loadmat(path)
    force, displacement, one, other = (np.asarray(table[name], float).ravel() for name in ("F", "x", "p1", "p2"))
    kilo = to_si(1.0, "kPa", "Pa", field="pressure")
    return PairRecord(np.arange(len(force)) * 1e-3, force, displacement, (kilo * one, kilo * other))


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
ISOMETRIC = BenchmarkData(
    files=tuple(sorted(run_name(*one) for one in itertools.product(RUN_LENGTHS, TEST_LENGTHS, RUN_KINDS))),
    digest="3312b0504fbd64b94a3f33f7fe9a81ad5341a05f8e85d7284320212d2a345eee",
    source=AARL,
    licence=NO_LICENCE,
)
LOOP = BenchmarkData(
    files=(f"{LOOP_FOLDER}/pressure_stroke_loop.csv", f"{LOOP_FOLDER}/step_response_100hz.csv"),
    digest="3687a5161433f9dff5eb2340be196101b84b6f2cc07b1945bb3710e0d675651b",
    source="public repository tbazina/pam_lqi_pid",
    licence=NO_LICENCE,
)
ROBOT = BenchmarkData(
    files=tuple(
        f"{ROBOT_FOLDER}/{jump}/{name}" for jump in JUMPS for name in sorted((ANGLES, PRESSURES, VALVES, FRAMES))
    ),
    digest="6e1967a7964b9427c3bf9d866b220dc19a35cd440ba00bb9da513c1faca17c1a",
    source="public repository borglab/GTDynamics, Georgia Tech Research Corp.",
    licence="BSD-style: read, not copied",
)
PAIR = BenchmarkData(
    files=("pneu_sim_antagonist/data.mat",),
    digest="479d7eb51187efad5ca368c62a3d0eb30104203d7b2f5595cc2be37b1b477d7d",
    source="public repository jonreal/pneu-sim",
    licence="Apache-2.0: read, not copied",
)
