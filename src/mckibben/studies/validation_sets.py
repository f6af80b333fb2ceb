"""The static data sets that every law is held against: where they are, what is known of the muscles, who measured them.

Two force maps ship with the package. The others ship with nothing, for their licences do not say that they may: they are
looked for below a folder of measured data, which the environment variable ``MCKIBBEN_DATA`` names.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError, MissingDataError
from ..quantities import to_si
from ..recordings import ForceMap, read_force_map
from ..specimens import map_file, specimen

VARIABLE = "MCKIBBEN_DATA"
MARTENS = "M. Martens, I. Boblan, Actuators 2017, 6(4), 33, doi:10.3390/act6040033"
AARL = "public repository Agile-and-Adaptive-Robotics/Muscle_Sensory, Portland State University"
NO_LICENCE = "none stated: read, not copied"
PLATEAUS = "aarl_10mm_isometric/quasistatic_plateaus.csv"
AARL_ZERO = to_si(9.2, "kPa", "Pa", field="pressure")  # what the sensor of those runs reads at rest


class Applied(NamedTuple):
    """A law of a specimen that is applied to a data set as it stands; `scaled` gives it the muscles' rest lengths."""

    specimen: str
    law: str
    scaled: bool = False


class StaticSet(NamedTuple):
    """One static data set: lengths, pressures and tensions of one muscle, or of several of a kind."""

    name: str  # in tables and figures
    title: str
    source: str
    licence: str
    known: Mapping[str, float]  # dimensions of the muscle [SI]
    file: str = ""  # below the folder of measured data; a map that ships has none
    ships_with: str = ""  # the specimen
    rest_length: float | None = None  # of a table without one [m]
    muscle: float | None = None  # keep the muscle of this rest length only [m]
    pressure_zero: float = 0.0  # [Pa]
    applied: tuple[Applied, ...] = ()
    note: str = ""

    def read(self, folder: Path | None) -> ForceMap:
        """The points.

        Raises:
            MissingDataError: if the file is not there.
            InputError: names file and column.
        """
        if self.ships_with:
            return read_force_map(map_file(specimen(self.ships_with)), rest_length=self.rest_length)
        if folder is None or not (folder / self.file).is_file():
            raise MissingDataError(f"{self.name}: no {self.file}; {VARIABLE} names the folder of measured data")
        points = read_force_map(folder / self.file, rest_length=self.rest_length, pressure_zero=self.pressure_zero)
        if self.muscle is None:
            return points
        assert points.rest_length is not None
        return points.select(np.isclose(points.rest_length, self.muscle))


def static_sets() -> tuple[StaticSet, ...]:
    """All of them, those that ship first."""
    maps = tuple(_map(name) for name in ("DMSP-10-250", "DMSP-20-300"))
    large = specimen("DMSP-20-300")
    sheet = StaticSet(
        name="DMSP-20 sheet",
        title="Festo DMSP-20, the maker's curves",
        source="data sheet of the maker, read off by hand",
        licence=NO_LICENCE,
        known=_dimensions("DMSP-20-300"),
        file="festo_datasheet/DMSP-20_force_contraction.csv",
        rest_length=large.property_si("rest_length", "m"),
        applied=tuple(Applied(large.id, law) for law in large.laws),
        note="The curves reach 4 % beyond the rest length, where the map of DMSP-20-300 has no points: there its laws are "
        "asked for more than they were made for.",
    )
    lengths = (0.083, 0.182, 0.281)
    return (*maps, sheet, *(_isometric(length) for length in lengths), _isometric(None))


def measured_data(folder: str | Path | None = None) -> Path | None:
    """The folder of measured data: the one given, else the one that the environment names, else none.

    Raises:
        InputError: if the folder is not there.
    """
    named = folder if folder is not None else os.environ.get(VARIABLE) or None
    if named is None:
        return None
    if not Path(named).is_dir():
        raise InputError("folder" if folder is not None else VARIABLE, str(named), "no such folder")
    return Path(named)


def branches_apart(points: ForceMap) -> tuple[float, float] | None:
    """Half of the gap between the rising and the falling branch, rms and largest [N]; None where only one was measured.

    A law without friction lies at best in the middle, so that its error on both branches cannot be smaller. At each
    length the falling branch is read by straight lines between its points.
    """
    if points.branch is None or len(set(points.branch)) < 2:
        return None
    rest = np.zeros(len(points)) if points.rest_length is None else points.rest_length
    gaps = []
    for one in np.unique(np.stack([rest, points.length]), axis=1).T:
        here = (rest == one[0]) & (points.length == one[1]) & points.taut
        up, down = (points.select(here & (points.branch == b)) for b in ("inflate", "deflate"))
        if len(down) < 2 or not len(up):
            continue
        order = np.argsort(down.pressure)
        both = (up.pressure >= down.pressure.min()) & (up.pressure <= down.pressure.max())
        falling = np.interp(up.pressure[both], down.pressure[order], down.tension[order])
        gaps.append(0.5 * (falling - up.tension[both]))
    found = np.concatenate(gaps) if gaps else np.zeros(0)
    return (float(np.sqrt(np.mean(found**2))), float(np.abs(found).max())) if len(found) else None


def _map(name: str) -> StaticSet:
    spec = specimen(name)
    return StaticSet(
        name=name,
        title=spec.title,
        source=MARTENS,
        licence="CC BY 4.0; ships",
        known=_dimensions(name),
        ships_with=name,
        rest_length=spec.property_si("rest_length", "m"),
        applied=tuple(Applied(name, law) for law in spec.laws if not was_fitted(name, law)),
    )


def _isometric(muscle: float | None) -> StaticSet:
    which = "all" if muscle is None else f"{muscle * 1e3:.0f} mm"
    return StaticSet(
        name=f"AARL {which}",
        title=f"Festo 10 mm, {'three rest lengths at once' if muscle is None else f'{which} at rest'}",
        source=AARL,
        licence=NO_LICENCE,
        known=_dimensions("DMSP-10-250"),
        file=PLATEAUS,
        muscle=muscle,
        pressure_zero=AARL_ZERO,
        applied=(Applied("DMSP-10-250", "hyperelastic_braid", True), Applied("DMSP-10-250", "sarosi", True)),
    )


def _dimensions(name: str) -> dict[str, float]:
    spec = specimen(name)
    return {
        "rest_diameter": spec.property_si("rest_inner_diameter", "m"),
        "wall_thickness": spec.property_si("wall_thickness", "m"),
    }


def was_fitted(name: str, law: str) -> bool:
    """Whether the numbers of a specimen's law were found by a fit of this project, and not printed by its source."""
    return any(p.note.startswith("fitted") for p in specimen(name).laws[law].values())
