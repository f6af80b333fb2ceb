"""Measured data of the benchmark: where they are, what they must contain, and how they are read.

Data without a licence that permits it do not ship. They are looked for below the folder of measured data, which the
environment variable ``MCKIBBEN_DATA`` names; a hash of their content shows whether they are the data that the splits were
made for. Compressed files are hashed as what they contain, so that it does not matter who compressed them.
"""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError, MissingDataError
from ..specimens import map_file, specimen
from ..studies.validation import AARL, LOOP_FOLDER, MARTENS, NO_LICENCE, PLATEAUS, ROBOT_FOLDER, VARIABLE

# Isometric runs of 10 mm muscles: cut lengths, mountings from stretched to slack, and runs.
CUTS = ("10cm", "20cm", "30cm")
MOUNTINGS = ("Unkink", "kinked25", "kinked50", "kinked75")
RUN_NAMES = ("Test8", "Test9", "Test10")
# Jumps of a robot, and the tables of each.
JUMP_NAMES = ("0p02_knee_80psi", "0p06_65psi", "0p09_65psi", "0p12_65psi")
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
LOOP = BenchmarkData(
    files=tuple(f"{LOOP_FOLDER}/{name}" for name in ("pressure_stroke_loop.csv", "step_response_100hz.csv")),
    digest="3687a5161433f9dff5eb2340be196101b84b6f2cc07b1945bb3710e0d675651b",
    source="public repository tbazina/pam_lqi_pid",
    licence=NO_LICENCE,
)
JUMPS = BenchmarkData(
    files=tuple(f"{ROBOT_FOLDER}/{jump}/{table}" for jump in JUMP_NAMES for table in JUMP_TABLES),
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
