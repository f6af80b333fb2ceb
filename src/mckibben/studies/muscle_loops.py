"""Study of a muscle's loop and creep: friction fitted to one half predicts the other.

Creep fitted to part of a hold predicts the rest.

They are those of a Festo DMSP-10-250 (tbazina/pam_lqi_pid; no licence stated, not shipped): a folder with
``pressure_stroke_loop.csv`` (``branch`` up or down, ``p_sensor_V``, ``stroke_mm``, ``p_bar_gauge``) and
``step_response_100hz.csv`` (``segment`` step_up or step_down, ``t_since_segment_start_s``, ``stroke_mm``,
``p_bar_sensor``). The sensor's volts are read by its sheet and not cut off at zero, as the table's own pressures are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, MissingDataError, choice
from ..formats.text import check_width, read_rows, to_numbers
from ..identification.creep_fit import FEWEST, LAWS, CreepFit, creep_half, fit_creep
from ..identification.hysteresis_fit import MODELS, SMOOTH, LoopFit, fit_loop, fit_loops
from ..identification.path_record import PathRecord
from ..quantities import from_si, to_si

LOOP, STEPS = "pressure_stroke_loop.csv", "step_response_100hz.csv"
SEGMENTS = ("step_up", "step_down")
SENSOR, SENSOR_ZERO = 0.9, -1.0  # by its sheet [bar/V], [bar]
AGREES = 1e-3  # between the volts and the table's own pressures, four decimals [bar]


def read_loop(folder: str | Path) -> PathRecord:
    """Read the loop of a folder, pressures from the sensor's volts.

    Raises:
        MissingDataError: if the file is not there.
        InputError: names file, column and what is wrong.
    """
    path = _file(folder, LOOP)
    words, numbers = _columns(path, "branch", ("p_sensor_V", "stroke_mm", "p_bar_gauge"))
    bar = SENSOR * numbers["p_sensor_V"] + SENSOR_ZERO
    off = float(np.abs(np.maximum(bar, 0.0) - numbers["p_bar_gauge"]).max())
    if off > AGREES:
        scale = f"{SENSOR:g} bar/V less {-SENSOR_ZERO:g} bar, which the volts give"
        problem = f"must be within {AGREES:g} bar of {scale}, got {off:.3g} bar off"
        raise InputError("p_bar_gauge", None, problem, where=str(path))
    _only(words, ("up", "down"), "branch", path)
    record = PathRecord(
        to_si(1.0, "bar", "Pa", field="pressure") * bar,
        to_si(1.0, "mm", "m", field="stroke") * numbers["stroke_mm"],
        str(path),
    )
    agreed = float(np.mean((record.branch == 1) == (words == "up")))
    if agreed < 0.9:
        problem = (
            f"must be up while the pressure rises and down while it falls, as it is in {agreed:.0%} of the rows only"
        )
        raise InputError("branch", None, problem, where=str(path))
    return record


def read_steps(folder: str | Path) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Read time since the step [s], stroke [m] and gauge pressure [Pa] of each segment; raises as `read_loop`."""
    path = _file(folder, STEPS)
    words, numbers = _columns(path, "segment", ("t_since_segment_start_s", "stroke_mm", "p_bar_sensor"))
    _only(words, SEGMENTS, "segment", path)
    time, stroke = numbers["t_since_segment_start_s"], to_si(1.0, "mm", "m", field="stroke") * numbers["stroke_mm"]
    pressure = to_si(1.0, "bar", "Pa", field="pressure") * numbers["p_bar_sensor"]
    return {s: (time[words == s], stroke[words == s], pressure[words == s]) for s in SEGMENTS}


def held_steps(folder: str | Path) -> dict[str, Segment]:
    """Read the part of each segment of a folder in which the pressure is held: time since the step, stroke, pressure.

    Raises as `read_loop`, and `InputError` for a pressure that is not held.
    """
    where = str(Path(folder) / STEPS)
    return {segment: _hold(segment, rows, where) for segment, rows in read_steps(folder).items()}


def _file(folder: str | Path, name: str) -> Path:
    path = Path(folder) / name
    if not path.is_file():
        raise MissingDataError(f"{folder}: no {name}; the folder must hold {LOOP} and {STEPS}")
    return path


def _columns(path: Path, word: str, names: tuple[str, ...]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Read a column of text and columns of numbers from a file, each (n,)."""
    where, lines = str(path), read_rows(path, str(path))
    header = [cell.strip() for cell in lines[0][1]] if lines else []
    for name in (word, *names):
        if header.count(name) != 1:
            raise InputError(name, None, f"is missing: the file has {', '.join(header) or 'nothing'}", where=where)
    rows = lines[1:]
    if not rows:
        raise InputError("file", None, "must have a header and rows", where=where)
    check_width(rows, len(header), f"the header has {len(header)} columns", where)
    at = {name: header.index(name) for name in (word, *names)}
    count = [n for n, _ in rows]
    words = np.array([row[at[word]].strip() for _, row in rows])
    return words, {n: to_numbers([row[at[n]] for _, row in rows], count, n, where) for n in names}


def _only(words: np.ndarray, allowed: tuple[str, ...], field: str, path: Path) -> None:
    if set(words) != set(allowed):
        names = ", ".join(sorted(set(words)))
        raise InputError(field, names, f"must be {' and '.join(allowed)}, each of them", where=str(path))


HELD_FROM = {"step_up": 0.49, "step_down": 0.37}  # from here the pressure stays put [s]
PUT = 0.06  # [bar]: three digits of the sensor
HOLD = 4.0  # how long the rise was held by the source's protocol; its last sample opens the next segment [s]
KNOTS = 9  # of the curve without friction: every 0.7 bar
SPACING = 0.25  # of the pressures at which widths are compared [bar]
MIDDLE = 0.5  # of the largest width: where the loop is wider, the pressure is mid-range
TARGET = 0.10  # error of the width there [share]
DRAWS, SEED = 200, 1
STAGES = 4 + len(HELD_FROM)  # how often `loop_study` reports progress


class Width(NamedTuple):
    """Width of the loop at a gauge pressure [Pa], measured and predicted [m], and whether that is mid-range."""

    pressure: float
    measured: float
    predicted: float
    middle: bool

    @property
    def error(self) -> float:
        """Relative error of the prediction."""
        return self.predicted / self.measured - 1.0 if self.measured else float("nan")


class Late(NamedTuple):
    """End of the hold: seconds after the first fitted sample, strokes [m], and the share due to drifting pressure [m]."""

    time: float
    predicted: float
    low: float
    high: float
    measured: float
    drift: float


@dataclass(frozen=True)
class StepCreep:
    """Creep after one step, fitted to the first half of the hold; `low` and `high` bound 95 % of the samples to come."""

    segment: str
    start: float  # of what is used, since the step [s]
    pressure: np.ndarray  # gauge (n,) [Pa]
    fit: CreepFit
    at: np.ndarray  # times of the band, since the start (m,) [s]
    low: np.ndarray  # (m,) [m]
    high: np.ndarray  # (m,) [m]
    late: Late | None

    @property
    def inside(self) -> tuple[int, int]:
        """Number of unseen samples within the band, and of all."""
        time, stroke = (x[~self.fit.train] for x in (self.fit.time, self.fit.stroke))
        low, high = (np.interp(time, self.at, x) for x in (self.low, self.high))
        return int(((stroke >= low) & (stroke <= high)).sum()), len(stroke)


@dataclass(frozen=True)
class LoopStudy:
    """Result of the study: loops at two pressures with the best friction of each; the predicted loop; widths; creep.

    `branches` are fits to the rising branch alone and to the falling branch alone.
    """

    record: PathRecord
    halves: tuple[LoopFit, LoopFit]
    unseen: PathRecord
    widths: tuple[Width, ...]
    branches: tuple[LoopFit, ...]
    steps: tuple[StepCreep, ...]

    @property
    def worst(self) -> Width:
        """Mid-range width with the largest error of prediction."""
        return max((w for w in self.widths if w.middle), key=lambda w: abs(w.error))

    def branch_errors(self) -> dict[str, float]:
        """Largest error of a mid-range width from one branch alone [share], ``up`` and ``down``; none if not fitted."""
        middle = [w for w in self.widths if w.middle]
        at, measured = np.array([w.pressure for w in middle]), np.array([w.measured for w in middle])
        errors = [float(np.abs(fit.width(at)[0] / measured - 1.0).max()) for fit in self.branches]
        return dict(zip(("up", "down"), errors, strict=False))

    @property
    def width_holds(self) -> bool:
        """Whether every mid-range width is predicted to `TARGET`."""
        return abs(self.worst.error) <= TARGET

    @property
    def swapped(self) -> tuple[Width, ...]:
        """Widths where the falling branch does not lie above the rising one, measured or predicted."""
        return tuple(w for w in self.widths if not (w.measured > 0.0 and w.predicted > 0.0))


def loop_study(
    folder: str | Path,
    *,
    frictions: Iterable[str] = SMOOTH,
    knots: int = KNOTS,
    alone: bool = True,
    draws: int = DRAWS,
    progress: Callable[[str], None] | None = None,
) -> LoopStudy:
    """Fit each half of the loop and predict the other; fit the first half of each hold and predict the second.

    Args:
        folder: with both files.
        frictions: which are tried on each half; the half alone chooses between them.
        knots: knots of the curve without friction.
        alone: fit each branch alone as well.
        draws: for the bands of the creep.
        progress: called with a description of the next stage, `STAGES` times if each branch is fitted alone.

    Raises:
        MissingDataError: if a file is not there.
        InputError: names the file and what is wrong with it.
    """
    tell, frictions = progress or (lambda _: None), tuple(frictions)
    for name in frictions or ("none",):
        if name not in MODELS:
            raise InputError("friction", name, f"must be {choice(MODELS)}")
    record, where = read_loop(folder), str(Path(folder) / STEPS)
    segments = read_steps(folder)
    holds = {s: _hold(s, rows, where) for s, rows in segments.items()}
    # Every other run of ten samples: both halves hold all of both branches but for gaps of 0.6 bar.
    train, halves = record.split("blocks"), []
    options: dict[str, Any] = {"known": {"per_pressure": 0.0}, "knots": knots}
    for which, training in (("first", train), ("second", ~train)):
        tell(f"loop, {which} half")
        halves.append(fit_loops(record, models=frictions, train=training, **options)[0])
    one, other = halves
    unseen = record.with_stroke(np.where(one.train, other.predicted, one.predicted))
    branches = []
    for way in ("up", "down") if alone else ():
        tell(f"loop, branch {way} alone")
        branches.append(fit_loop(record, model=one.model, train=record.split(way), **options))
    steps = []
    for segment, rows in holds.items():
        tell(f"creep, {segment.replace('_', ' ')}")
        after = segments["step_down"] if segment == "step_up" else None
        steps.append(_creep(segment, rows, after, record, draws))
    return LoopStudy(record, (one, other), unseen, compared(record, unseen), tuple(branches), tuple(steps))


def compared(record: PathRecord, unseen: PathRecord) -> tuple[Width, ...]:
    """Compare widths of a measured and a predicted loop at every multiple of `SPACING` above zero within both branches."""
    top = from_si(float(record.pressure.max()), "Pa", "bar")
    at = to_si(1.0, "bar", "Pa", field="pressure") * SPACING * np.arange(int(max(top, 0.0) / SPACING) + 1)
    measured, predicted = record.width(at), unseen.width(at)
    known = np.isfinite(measured) & np.isfinite(predicted)
    if not (known.any() and measured[known].max() > 0.0):
        raise InputError("loop", None, "has no width: the stroke must be longer while falling", where=record.name)
    middle = measured >= MIDDLE * measured[known].max()
    rows = zip(at[known], measured[known], predicted[known], middle[known], strict=True)
    return tuple(Width(float(p), float(m), float(s), bool(i)) for p, m, s, i in rows)


Segment = tuple[np.ndarray, np.ndarray, np.ndarray]  # time [s], stroke [m], gauge pressure [Pa]


def _hold(segment: str, rows: Segment, where: str) -> Segment:
    """A segment from where its pressure is held, or an error message that it is not."""
    start, name = HELD_FROM[segment], f"{where}, {segment}"
    time, stroke, pressure = (x[rows[0] >= start - 1e-6] for x in rows)
    if len(time) < 2 * FEWEST:
        allowed = f"must be {2 * FEWEST} or more after {start:g} s"
        raise InputError("samples", len(time), allowed, where=name)
    if not (np.diff(time) > 0.0).all():
        raise InputError("t_since_segment_start_s", None, "must rise", where=name)
    if (moved := from_si(float(np.ptp(pressure)), "Pa", "bar")) > PUT:
        reason = f"moves by {moved:.3g} bar after {start:g} s"
        raise InputError("p_bar_sensor", reason, f"must be a step held to {PUT:g} bar", where=name)
    return time, stroke, pressure


def _creep(segment: str, rows: Segment, after: Segment | None, record: PathRecord, draws: int) -> StepCreep:
    """Fit the creep of a held step; `after` is the segment whose first sample ends the hold."""
    start, (time, stroke, pressure) = HELD_FROM[segment], rows
    half = creep_half(time)
    fit = min((fit_creep(time, stroke, train=half, law=law) for law in LAWS), key=lambda f: f.aicc)
    end = HOLD - start if after is not None else float(fit.time[-1])
    at = np.unique(np.concatenate([fit.time, np.geomspace(fit.time[1], end, 60)]))
    low, high = _band(fit, at, HOLD, draws)
    late = None
    if after is not None:
        slope = _slope(record, float(pressure[-1]))
        drift = slope * float(after[2][0] - pressure[-1])
        late = Late(end, float(fit.predict(end)), float(low[-1]), float(high[-1]), float(after[1][0]), drift)
    return StepCreep(segment, start, pressure, fit, at, low, high, late)


def _band(fit: CreepFit, at: np.ndarray, longest: float, draws: int) -> tuple[np.ndarray, np.ndarray]:
    """Range that should contain 95 % of the coming strokes, from the fitted samples alone.

    Its errors are drawn again in runs of a quarter of the record, for they follow one another, and the fit is repeated;
    once with its own elements and once with slower ones, up to `longest` [s], which the seen half cannot exclude. The
    band holds both, and the scatter of single samples.
    """
    training, draw = fit.train, np.random.default_rng(SEED)
    time, count = fit.time[training], int(training.sum())
    run = max(2, count // 4)
    edges = []
    for slowest in (None, longest):
        fitted = fit_creep(time, fit.stroke[training], law=fit.law, longest=slowest)
        used = 1 + sum(abs(a.value) > 0.0 for a in fitted.amplitudes)
        error = (fitted.error - fitted.error.mean()) * np.sqrt(count / max(count - used, 1))
        begins = draw.integers(0, count - run + 1, size=(draws, -(-count // run)))
        shaken = error[begins[..., None] + np.arange(run)].reshape(draws, -1)[:, :count]
        tried = [fit_creep(time, fitted.predicted + e, law=fit.law, longest=slowest).predict(at) for e in shaken]
        centre, scatter = fitted.predict(at), 1.96 * float(np.std(error))
        low, high = np.quantile(tried, [0.025, 0.975], axis=0)
        edges.append((centre - np.hypot(centre - low, scatter), centre + np.hypot(high - centre, scatter)))
    return np.minimum(edges[0][0], edges[1][0]), np.maximum(edges[0][1], edges[1][1])


def _slope(record: PathRecord, pressure: float) -> float:
    """Stroke per pressure of the rising branch within half a bar of a pressure [m/Pa]; NaN if it has no samples."""
    near = (record.branch == 1) & (
        np.abs(record.pressure - pressure) <= 0.5 * to_si(1.0, "bar", "Pa", field="pressure")
    )
    if near.sum() < 3:
        return float("nan")
    return float(np.polyfit(record.pressure[near] - pressure, record.stroke[near], 1)[0])
