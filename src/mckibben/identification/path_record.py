"""A measured loop of pressure and stroke in the order of its path, with its turning points, branches and width."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .._jax import Scalar
from ..errors import InputError, choice
from ..formats.columns import column_numbers, table_labels
from ..formats.labels import parse_header, quantity_of
from ..quantities import to_si
from ..recordings.force_map import table_of

# A reversal smaller than this share of the range is noise and no turning point.
NOISE = 0.05
FEWEST = 12
SPLITS = ("all", "odd", "blocks", "up", "down", "low", "high")


@dataclass(frozen=True)
class PathRecord:
    """Gauge pressure [Pa] and stroke [m], both (n,), along one path that turns at least once.

    `time` (n,), in any unit, never falls; samples are taken as evenly spaced where it is None.
    """

    pressure: np.ndarray
    stroke: np.ndarray
    name: str = "record"
    time: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Refuse what holds no loop."""
        for field in ("pressure", "stroke"):
            try:
                value = np.asarray(getattr(self, field), float)
            except (TypeError, ValueError):
                raise InputError(field, None, "must be one number per sample", where=self.name) from None
            if value.ndim != 1 or not np.isfinite(value).all():
                raise InputError(field, None, "must be one finite number per sample", where=self.name)
            object.__setattr__(self, field, value)
        if len(self.pressure) != len(self.stroke):
            sizes = f"{len(self.pressure)} and {len(self.stroke)}"
            raise InputError("pressure, stroke", sizes, "must be as many of one as of the other", where=self.name)
        if len(self.pressure) < FEWEST:
            raise InputError("samples", len(self.pressure), f"must be {FEWEST} or more", where=self.name)
        if not np.ptp(self.stroke) > 0.0:
            raise InputError("stroke", None, "must follow the pressure; it is constant", where=self.name)
        if self.time is not None:
            time = np.asarray(self.time, float)
            if time.shape != self.pressure.shape or not (np.diff(time) >= 0.0).all() or not np.ptp(time) > 0.0:
                raise InputError("time", None, "must be one number per sample that never falls", where=self.name)
            object.__setattr__(self, "time", time)
        if not len(self.turning_points):
            raise InputError("pressure", None, "has no turning point: a loop rises and falls", where=self.name)

    def with_stroke(self, stroke: np.ndarray) -> PathRecord:
        """Return the path of pressure with another stroke [m]."""
        return replace(self, stroke=stroke)

    @property
    def durations(self) -> np.ndarray:
        """Time since the sample before, (n,), as a share of the whole record; the first is that of a return to the start."""
        time = np.arange(len(self.pressure), dtype=float) if self.time is None else self.time
        steps: np.ndarray = np.diff(time, prepend=time[0]) / np.ptp(time)
        steps[0] = float(np.mean(steps[1:]))
        return steps

    @property
    def turning_points(self) -> np.ndarray:
        """Samples at which the pressure turns, but for the ends and for noise."""
        least, p = NOISE * float(np.ptp(self.pressure)), self.pressure
        if least == 0.0:
            return np.zeros(0, int)
        turns, top, bottom, way = [], 0, 0, 0
        for i in range(1, len(p)):
            top, bottom = (i if p[i] > p[top] else top), (i if p[i] < p[bottom] else bottom)
            if way >= 0 and p[top] - p[i] > least:
                turns += [top] if way > 0 else []
                way, bottom = -1, i
                top = i
            elif way <= 0 and p[i] - p[bottom] > least:
                turns += [bottom] if way < 0 else []
                way, top = 1, i
                bottom = i
        return np.array(turns, int)

    @property
    def branch(self) -> np.ndarray:
        """+1 while the pressure rises and -1 while it falls, (n,); a turning point ends its branch."""
        way = np.empty(len(self.pressure), int)
        ends = [0, *(self.turning_points + 1), len(self.pressure)]
        for a, b in zip(ends[:-1], ends[1:], strict=True):
            way[a:b] = 1 if self.pressure[b - 1] >= self.pressure[a] else -1
        return way

    def width(self, pressure: Scalar) -> np.ndarray:
        """Stroke while falling minus stroke while rising, at gauge pressures [Pa], of the largest branches [m].

        NaN if a branch does not reach; each branch is read by straight lines between samples in order of pressure.
        """
        rising, falling = (self._read(way, np.asarray(pressure, float)) for way in (1, -1))
        width: np.ndarray = falling - rising
        return width

    def _read(self, way: int, at: np.ndarray) -> np.ndarray:
        some = self.branch == way
        p, s = self.pressure[some], self.stroke[some]
        if not p.size:
            return np.full(at.shape, np.nan)
        level, place = np.unique(p, return_inverse=True)
        mean = np.bincount(place, weights=s) / np.bincount(place)
        branch: np.ndarray = np.interp(at, level, mean, left=np.nan, right=np.nan)
        return branch

    def chosen(self, train: np.ndarray | None) -> np.ndarray:
        """A selection of samples as bool (n,); all by default."""
        selection = np.ones(len(self.pressure), bool) if train is None else np.asarray(train)
        if selection.shape != self.pressure.shape or selection.dtype != bool:
            allowed = f"must be bool ({len(self.pressure)},), got {selection.dtype} {selection.shape}"
            raise InputError("train", None, allowed, where=self.name)
        return selection

    def split(self, how: str, *, block: int = 10) -> np.ndarray:
        """Samples to fit, bool (n,).

        Args:
            how: ``all``; ``odd`` every other sample; ``blocks`` every other run of `block` samples; ``up`` or ``down`` one
                branch; ``low`` or ``high`` the samples below or above the middle of the pressures, on both branches.
            block: samples in a block.
        """
        number, middle = np.arange(len(self.pressure)), 0.5 * (self.pressure.min() + self.pressure.max())
        if block < 1:
            raise InputError("block", block, "must be 1 or more", where=self.name)
        kinds = {
            "all": number >= 0,
            "odd": number % 2 == 1,
            "blocks": (number // block) % 2 == 0,
            "up": self.branch == 1,
            "down": self.branch == -1,
            "low": self.pressure <= middle,
            "high": self.pressure > middle,
        }
        if how not in kinds:
            raise InputError("train", how, f"must be {choice(SPLITS)}", where=self.name)
        samples: np.ndarray = kinds[how]
        return samples


STROKES = ("stroke", "displacement", "travel", "shortening", "hub", "weg")  # labels of a column of strokes
LENGTHS = ("span", "length")  # of one of lengths, which the stroke shortens
MOST = 400  # samples of a path; a longer record is thinned, for quasi-static friction knows no time


def read_path(
    path: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    pressure_zero: float = 0.0,
    timed: bool = False,
) -> PathRecord:
    """Read a loop of pressure and stroke, or of pressure and length, from a file of any format.

    Args:
        path: a table, or a recording; of a long one evenly `MOST` samples are read.
        columns: label or number of the column of ``pressure``, and of ``stroke`` or ``length``, where they have other names.
        units: unit of such a column whose header has none.
        pressure_zero: what the pressure channel reads at zero gauge pressure [Pa].
        timed: also read the column of times, if there is one.

    Raises:
        InputError: names file, column and what is allowed.
    """
    where, table = str(path), table_of(Path(path))
    labels = table_labels(table)
    names = [parse_header(0, label)[0].rpartition(".")[2] for label in labels]
    places = {
        "pressure": [i for i, name in enumerate(names) if quantity_of(name) == "pressure"],
        "stroke": [i for i, name in enumerate(names) if name in STROKES],
        "length": [i for i, name in enumerate(names) if name in LENGTHS],
    }
    for quantity, column in (columns or {}).items():
        if quantity not in places:
            raise InputError("column", quantity, known=places, where=where)
        places[quantity] = [_column(column, labels, where)]
    moved = "stroke" if places["stroke"] or not places["length"] else "length"
    values = {}
    for quantity, unit in (("pressure", "Pa"), (moved, "m")):
        if len(places[quantity]) != 1:
            problem = f"must be one column; the file has {', '.join(labels)}"
            raise InputError(quantity, None, problem, where=where, remedy=f"column {quantity}")
        place = places[quantity][0]
        source = parse_header(0, labels[place])[1]
        stated = (units or {}).get(quantity, source.unit)
        if stated is None:
            raise InputError(labels[place], None, "has no unit", where=where, remedy=f"unit {quantity}")
        numbers = column_numbers(table.columns[place], table.rows, where)
        values[quantity] = to_si(1.0, stated, unit, field=labels[place], where=where) * numbers
    every = -(-len(values["pressure"]) // MOST)
    stroke = values["stroke"] if moved == "stroke" else values["length"].max() - values["length"]
    clocks = [i for i, name in enumerate(names) if quantity_of(name) == "time"] if timed else []
    time = column_numbers(table.columns[clocks[0]], table.rows, where)[::every] if len(clocks) == 1 else None
    return PathRecord((values["pressure"] - pressure_zero)[::every], stroke[::every], where, time)


def _column(column: str | int, labels: list[str], where: str) -> int:
    """Place of a column by its label, its label without unit, or its number from 1."""
    if isinstance(column, int):
        if not 1 <= column <= len(labels):
            raise InputError("column", column, f"must be between 1 and {len(labels)}", where=where)
        return column - 1
    alike = [i for i, label in enumerate(labels) if column in (label, label.partition(" [")[0])]
    if len(alike) != 1:
        raise InputError("column", column, "the file has", known=labels, where=where)
    return alike[0]
