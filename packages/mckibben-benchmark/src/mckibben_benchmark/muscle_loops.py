"""Study of a muscle's loop and creep: friction fitted to one half predicts the other.

Creep fitted to part of a hold predicts the rest.

They are those of a Festo DMSP-10-250 (tbazina/pam_lqi_pid; no licence stated, not shipped): a folder with
``pressure_stroke_loop.csv`` (``branch`` up or down, ``p_sensor_V``, ``stroke_mm``, ``p_bar_gauge``) and
``step_response_100hz.csv`` (``segment`` step_up or step_down, ``t_since_segment_start_s``, ``stroke_mm``,
``p_bar_sensor``). The sensor's volts are read by its sheet and not cut off at zero, as the table's own pressures are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mckibben.answers import Answer, Column, Table
from mckibben.documents import JsonValue
from mckibben.errors import InputError, MissingDataError, choice
from mckibben.formats.text import check_width, read_rows, to_numbers
from mckibben.identification.creep_fit import FEWEST, LAWS, CreepFit, creep_half, fit_creep
from mckibben.identification.hysteresis_fit import AREA, MODELS, SMOOTH, LoopFit, fit_loop, fit_loops
from mckibben.identification.path_record import PathRecord
from mckibben.quantities import from_si, to_si
from mckibben.verbs import DataFolder, LoopFriction, verb

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
HALVES = ("first", "second")
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

    def to_dict(self) -> dict[str, JsonValue]:
        """All of it with the error."""
        return {**self._asdict(), "error": self.error}


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

    def to_dict(self) -> dict[str, JsonValue]:
        """The fitted creep, its errors [m], courses and band as plain values [SI]."""
        inside, count = self.inside
        return {
            "segment": self.segment,
            "start": self.start,
            "law": self.fit.law,
            "time_constants": self.fit.time_constants,
            "amplitudes": [a._asdict() for a in self.fit.amplitudes],
            **stroke_errors(self.fit),
            "inside_band": inside,
            "unseen": count,
            "time": self.fit.time,
            "stroke": self.fit.stroke,
            "predicted": self.fit.predicted,
            "fitted": self.fit.train,
            "band": {"time": self.at, "low": self.low, "high": self.high},
            "end_of_hold": self.late._asdict() if self.late else None,
            "warnings": list(self.fit.warnings),
        }


@dataclass(frozen=True)
class LoopStudy(Answer):
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

    def failure(self) -> str | None:
        """Empty where the width or the order of the branches is missed, which the remarks say."""
        return "" if self.swapped or not self.width_holds else None

    def to_dict(self) -> dict[str, JsonValue]:
        """Both halves, widths, loop and steps as plain values [SI]."""
        halves = [
            {
                "fitted": which,
                "friction": half.model,
                "parameters": {name: e._asdict() for name, e in half.parameters.items()},
                "curve": half.curve,
                **stroke_errors(half),
                "samples": int(half.train.sum()),
                "converged": half.converged,
                "warnings": list(half.warnings),
            }
            for which, half in zip(HALVES, self.halves, strict=True)
        ]
        return {
            "width_holds": self.width_holds,
            "order_holds": not self.swapped,
            "worst": self.worst.to_dict(),
            "widths": [w.to_dict() for w in self.widths],
            "halves": halves,
            "branch_errors": self.branch_errors(),
            "loop": {"pressure": self.record.pressure, "stroke": self.record.stroke, "predicted": self.unseen.stroke},
            "steps": [one.to_dict() for one in self.steps],
            "cannot": self.limits(),
        }

    def tables(self) -> list[Table]:
        """Errors of both halves and their parameters, the widths, and the creep of each step."""
        halves = list(zip(HALVES, self.halves, strict=True))
        which = Column("which", "fitted half")
        errors = [_millimetres(key, title, ".3f") for key, title in
                  (("rms_seen", "seen"), ("rms_unseen", "unseen"), ("largest_unseen", "largest unseen"))]  # fmt: skip
        fits = [{"which": name, "friction": half.model, **stroke_errors(half)} for name, half in halves]
        parameters = [
            {"which": name, "parameter": key, "unit": e.unit, **e._asdict(), "band": f"{e.low:.3g} to {e.high:.3g}"}
            for name, half in halves
            for key, e in half.parameters.items()
        ]
        value = Column("said", "value", right=True)
        parameters = [row | {"said": _shown(row["value"], str(row["unit"]))} for row in parameters]
        widths = [w.to_dict() | {"where": "mid-range" if w.middle else ""} for w in self.widths]
        measured = (_millimetres("measured", "measured", ".2f"), _millimetres("predicted", "model", ".2f"))
        share = Column("error", "error", "1", shown="%", places="+.1f")
        steps = []
        for one in self.steps:
            last = int(abs(one.at - one.fit.time[-1]).argmin())  # of the band, at the end of the record
            steps.append(
                {
                    "step": one.segment.replace("_", " "),
                    "held": f"{one.start:g} to {one.start + one.fit.time[-1]:.2f}",
                    "until": one.start + one.fit.time[one.fit.train][-1],
                    "law": one.fit.law,
                    **stroke_errors(one.fit),
                    "crept": abs(one.fit.stroke[-1] - one.fit.stroke[0]),
                    "inside": "{} of {}".format(*one.inside),
                    "width": one.high[last] - one.low[last],
                }
            )
        held = (
            Column("step"),
            Column("held", "held, s"),
            Column("until", "fitted to", "s", places=".2f"),
            Column("law"),
        )
        band = (Column("inside", "in the 95 % band", right=True), _millimetres("width", "its width at the end", ".2f"))
        return [
            Table(
                "Each half of the loop from the other, rms errors of the stroke",
                (which, Column("friction"), *errors),
                fits,
            ),
            Table("", (which, Column("parameter"), value, Column("band", "95 %", right=True)), parameters),
            Table(
                "Width of the loop, each sample by the half that did not see it",
                (Column("pressure", unit="Pa", places=".2f"), *measured, share, Column("where", "")),
                widths,
            ),
            Table(
                "Creep after a step, its second half from its first",
                (*held, *errors, _millimetres("crept", "crept", ".2f"), *band),
                steps,
            ),
        ]

    def remarks(self) -> list[str]:
        """What was held and missed, and what these records cannot tell."""
        middle = [w.pressure for w in self.widths if w.middle]
        held, worst = "HELD" if self.width_holds else "MISSED", self.worst
        lines = [
            f"{held}: the width is right to {100.0 * TARGET:g} % where the loop is at least {MIDDLE:g} times as wide as "
            f"at its widest ({_bar(min(middle)):g} to {_bar(max(middle)):g} bar); worst {100.0 * worst.error:+.1f} % at "
            f"{_bar(worst.pressure):g} bar"
        ]
        wrong = ", ".join(f"{_bar(w.pressure):g}" for w in self.swapped)
        ends = f"{_bar(self.widths[0].pressure):g} to {_bar(self.widths[-1].pressure):g} bar"
        order = "the falling branch lies above the rising one, measured and predicted"
        held = f"HELD: {order}, at all of {len(self.widths)} pressures, {ends}"
        lines.append(f"MISSED: {order}; not so at {wrong} bar" if wrong else held)
        for which, half in zip(HALVES, self.halves, strict=True):
            lines += [f"note: {which} half: {one}" for one in half.warnings]
        for step in self.steps:
            lines += [f"note: {step.segment.replace('_', ' ')}: {one}" for one in step.fit.warnings]
        return [*lines, "", "What these records cannot tell:", *(f"  {line}" for line in self.limits())]

    def limits(self) -> list[str]:
        """Limits of what these records can predict, a sentence each."""
        said = []
        outside = [w for w in self.widths if not w.middle]
        if outside:
            worst = max(outside, key=lambda w: abs(w.error) if math.isfinite(w.error) else math.inf)
            said.append(
                f"The ends of the loop: where it is narrow the width is missed by up to {100.0 * abs(worst.error):.0f} %, "
                f"at {_bar(worst.pressure):.2f} bar ({_mm(worst.predicted)} mm predicted, {_mm(worst.measured)} mm "
                "measured)."
            )
        if alone := self.branch_errors():
            said.append(
                f"One branch from the other: from the rising branch alone mid-range widths are missed by up to "
                f"{100.0 * alone['up']:.0f} %, from the falling one alone by up to {100.0 * alone['down']:.0f} %. The "
                "halves above are runs of ten samples in turns, on both branches."
            )
        turns = len(self.record.turning_points)
        if turns == 1:
            said.append("Loops within the loop: the record turns once, so that no smaller loop is compared.")
        said.append(
            "The friction as a force: no load was measured. Forces and stiffnesses are stated for a nominal area of "
            f"{from_si(AREA, 'm^2', 'cm^2'):g} cm2, which the stroke does not depend on; only their ratio to it is "
            "from the data."
        )
        for which, h in zip(HALVES, self.halves, strict=True):
            loose = [n for n, e in h.parameters.items() if not (e.low > 0.0 and e.high < 3.0 * e.low)]
            if loose:
                values = {n: h.parameters[n] for n in loose}
                names = ", ".join(
                    f"{n} {_shown(e.value, e.unit)} ({e.low:.3g} to {e.high:.3g})" for n, e in values.items()
                )
                said.append(f"Parameters of {h.model} from the {which} half that the loop hardly fixes: {names}.")
        for s in self.steps:
            if s.late is None:
                continue
            end, late = s.start + s.late.time, s.late
            text = (
                f"The end of the hold: {_mm(late.predicted)} mm predicted at {end:g} s, {_mm(late.measured)} mm measured, "
                f"from {s.fit.time[s.fit.train][-1]:.2f} s of creep; with elements slower than those, {_mm(late.low)} to "
                f"{_mm(late.high)} mm would fit as well."
            )
            if math.isfinite(late.drift) and late.drift:
                text += f" The pressure drifts meanwhile, which the loop's slope makes {_mm(late.drift)} mm of it."
            said.append(text)
        return said


def stroke_errors(fit: LoopFit | CreepFit) -> dict[str, float]:
    """Errors of the stroke, of the samples that a fit has seen and of the others [m]."""
    return {
        "rms_seen": fit.rmse(seen=True),
        "rms_unseen": fit.rmse(seen=False),
        "largest_unseen": fit.max_error(seen=False),
    }


def _millimetres(key: str, title: str, places: str) -> Column:
    return Column(key, title, "m", shown="mm", places=places)


def _mm(length: float) -> str:
    return f"{from_si(float(length), 'm', 'mm'):.2f}"


def _bar(pressure: float) -> float:
    return from_si(pressure, "Pa", "bar")


def _shown(value: float, unit: str) -> str:
    return f"{value:.3g}{'' if unit == '1' else f' {unit}'}"


@verb
def loop_study(
    folder: DataFolder,
    *,
    frictions: Sequence[LoopFriction] | None = None,
    knots: int | None = None,
    alone: bool | None = True,
    draws: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> LoopStudy:
    """Predict half of a muscle's loop and creep from the other half.

    The first half of each hold predicts its second. The exit code is 1 when the width or the order of the branches is
    missed.

    Args:
        folder: folder with the loop and the steps of a DMSP-10-250.
        frictions: friction model to try on each half: maxwell_slip, dahl or bouc_wen; by default the last two.
        knots: knots of the curve without friction.
        alone: fit each branch alone as well.
        draws: for the bands of the creep.
        progress: called with a description of the next stage, `STAGES` times if each branch is fitted alone.

    Raises:
        MissingDataError: if a file is not there.
        InputError: names the file and what is wrong with it.
    """
    tell, frictions = progress or (lambda _: None), tuple(SMOOTH if frictions is None else frictions)
    knots, draws = KNOTS if knots is None else knots, DRAWS if draws is None else draws
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
