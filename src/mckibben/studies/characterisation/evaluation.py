"""What the recordings of a characterisation's stages say of the muscle.

Zeros of the load cell and the pressure sensor are those of the vented, slack muscle. The law is fitted to the mean of both
branches of the map's loops, less what friction and relaxation leave in it; friction is fitted to the difference of the
branches and relaxation to a hold, so that both need no law. The points of the last stage are in none of these fits: their
errors say how well the whole predicts, and give the 95 % interval of a predicted tension,

    half width = t_(0.975, n) sqrt(sum e_i^2 / n + 2 (g F)^2)

for n held-out points of errors e_i, a standard uncertainty g of the gains of load cell and pressure sensor, which no
reading shows, and the largest tension F.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...analysis.loops import TensionPath
from ...analysis.steps import pressure_decay
from ...answers import brief
from ...documents import JsonValue
from ...errors import InputError, StageError
from ...estimation import NORMAL_QUANTILE, Estimate, uncertainty, widening
from ...identification.fit import Fit, fit_all, fitted_specimen, measured_range
from ...identification.problem import Problem
from ...identification.tension_path_fit import (
    AT_PRESSURE,
    ELEMENTS,
    BranchFit,
    RelaxationFit,
    SpanPath,
    fit_branches,
    fit_relaxation,
    friction_force,
    relaxation_force,
)
from ...muscles import Muscle, braid
from ...muscles.laws import LAWS
from ...quantities import with_unit
from ...recordings import ForceMap, Recording
from ...specimens import Specimen, SpecimenNumber
from .stages import AGAIN, ISOBARS, Bounds, Progression

SAMPLES = 3000  # of a path to which every recording is resampled, so that what is compiled serves all
PAIRS = 120  # points of the map
WINDOW = 0.012  # half width in which a branch is read, of the rest length
ENDS = (0.06, 0.04)  # of a loop's length range that is left out where it is short and where it is long
TAUT = 0.02  # of the largest tension, above which a point counts
PULLS = 0.4  # of the largest tension, from which on a loop shows a gain that changes
MEMORIES = (3.0, 15.0)  # time constants of what is left of the relaxation from before [s]
MOST_GAIN = 0.003  # by which the tensions of that loop may have changed at its repetition, beyond the error of that
LEAST_LOOP = 0.02  # length range of a loop that counts, of the rest length
LEAST_TENSION = 3.0  # largest tension that a muscle must reach [N], and in noise of the cell
NOISES = 40.0
GAIN_ERROR = 2e-3  # standard uncertainty of the sensors' gains by default, a share
CORD_ERROR = 0.03  # standard uncertainty of what a known cord stretches, a share
MOST_DECAY = 0.03  # share of the pressure that a leak may take in a second [1/s]
# Of a sensor's zero during the map, of the largest value. A large muscle that empties slowly may keep 0.15 % of the pressure
# for a while, and a slack one 0.8 % of the tension: that is no drift.
MOST_DRIFT = {"tension": 0.01, "pressure": 0.003}
MOST_SWING = 0.01  # standard deviation of the span that is to stand still, of the rest length
MOST_ERROR = 0.05  # rms error of the held-out points, of the largest tension
SETTLED = 0.5  # after the stretch, which the pressure needs [s]
SLOPE_ERROR = 0.3  # standard error of the tension per pressure beside the hold, a share: friction holds some of it
STICKING = 1.5  # stiffness to small movements over that of the map: friction that sticks adds up to as much again
LONGEST = 1.02  # up to which a law is meant, of the rest length
PULLED = 0.02  # by which the vented muscle is pulled beyond its rest length, a share
SEAT_ERROR = 1e-3  # of the span at which it gets taut, beside noise, of the rest length
ONSET = 3e-3  # stretch over which friction and rubber begin to pull, of the rest length
READ = 1.0  # end of a hold that is averaged [s]


@dataclass(frozen=True)
class HeldOut:
    """A point that no fit has seen: length [m], gauge pressure [Pa], measured and predicted tension [N]."""

    length: float
    pressure: float
    measured: float
    predicted: float


@dataclass(frozen=True)
class Evaluation:
    """What was found.

    Attributes:
        points: of the map, without friction and relaxation.
        fits: of the laws, best first.
        skipped: laws that could not be fitted, and why.
        friction: from the difference of the branches.
        relaxation: from the hold.
        leak: share of the pressure that is lost per second; None where nothing shuts the muscle off.
        seat: span at which the vented muscle gets taut, with its 95 % interval [m]; NaN and an open end if it did not.
        clamp: least and largest length by which a span may be longer than the muscle itself [m].
        held_out: points of the last stage.
        half_width: of the 95 % interval of a predicted tension [N].
        largest: largest tension [N].
        gain_change: by which the tensions of a loop at equal pressure have changed from the map to the end, a share: by a
            gain of the load cell or the pressure sensor; with its 95 % interval.
        lengths: shortest and longest of the map's loops [m].
    """

    points: ForceMap
    fits: tuple[Fit, ...]
    skipped: dict[str, str]
    friction: BranchFit
    relaxation: RelaxationFit
    leak: Estimate | None
    seat: Estimate
    clamp: tuple[float, float]
    held_out: tuple[HeldOut, ...]
    half_width: float
    largest: float
    gain_change: Estimate
    lengths: tuple[float, float]

    __repr__ = brief

    @property
    def error(self) -> np.ndarray:
        """Errors of the held-out points (n,) [N]."""
        return np.array([p.predicted - p.measured for p in self.held_out])


def advance(stage: str, record: Recording, bounds: Bounds, known: Progression) -> Progression:
    """Add to what is known what the next stages need of a stage's recording.

    Raises:
        StageError: the muscle cannot be characterised further; says why.
    """
    if stage == "seat":
        # what a motor does to a slack muscle that it does not hold would be taken for the muscle's
        swing = float(np.std(part_of(record, "zero", stage)["span"]))
        if swing > MOST_SWING * bounds.rest_length:
            by = with_unit(swing, "m", 2)
            raise StageError(
                "seat",
                f"the span swings by {by} where it is to stand still; choose another rig, or lower the motor's gains",
            )
        rest = part_of(record, "zero", stage)["tension"]
        noise = float(np.std(rest))
        pressure = float(np.mean(part_of(record, "zero", stage)["pressure"]))
        zero = float(np.mean(rest))
        known = dataclasses.replace(known, zero=zero, zero_pressure=pressure, slack=max(known.slack, 6.0 * noise))
        _check_seat(seat_of(record, bounds), bounds)
        return known
    if stage == "leak":
        leak, before, shut = leak_of(record), part_of(record, "settle", "leak"), part_of(record, "shut", "leak")
        # from before the shut-off to its end, which sees the quickest leak
        left = float(np.mean(shut.select(start=shut.time[-1] - 0.5)["pressure"]) / np.mean(before["pressure"]))
        fall = (1.0 - left) / shut.duration
        if leak.low > MOST_DECAY or fall > MOST_DECAY:
            share = f"{100.0 * max(leak.value, fall):.2g} % of its pressure per second"
            raise StageError(
                stage, f"the shut muscle loses {share}, more than {100.0 * MOST_DECAY:g} %; tighten its fittings"
            )
        return known
    if stage == "ramp":
        return _ramped(record, bounds, known)
    if stage == "map":
        _check_zeros(record, known)
        isobars = []  # pressure and shortest taut length of each loop; the rest length where it is slack all along
        for i in range(1, ISOBARS + 1):
            pressure = float(np.mean(part_of(record, f"settle {i}", "map")["pressure"]))
            shortest = float(part_of(record, f"shorten {i}", "map")["span"][-1])
            isobars.append((pressure, min(shortest, bounds.rest_length)))
        taut = [length for _, length in isobars if length < (1.0 - LEAST_LOOP) * bounds.rest_length]
        if not taut:
            share = f"{100.0 * LEAST_LOOP:g} % of its length"
            raise StageError(
                stage, f"the muscle pulls along less than {share} at every pressure; check the rest length"
            )
        # measured again at the end is the earliest loop that pulls well, long before its repetition
        pulls = [float(np.max(part_of(record, f"lengthen {i}", "map")["tension"])) for i in range(1, ISOBARS + 1)]
        again = next((i for i, pull in enumerate(pulls, 1) if pull - known.zero >= PULLS * known.largest), ISOBARS)
        return dataclasses.replace(known, isobars=tuple(isobars), again=again)
    return known


def _ramped(record: Recording, bounds: Bounds, known: Progression) -> Progression:
    rise = part_of(record, "rise", "ramp")
    tension, pressure = rise["tension"] - known.zero, rise["pressure"]
    largest = float(np.mean(tension[-5:]))
    least = max(LEAST_TENSION, NOISES / 6.0 * (known.slack if known.slack > 1.0 else 0.0) / 6.0)
    if largest < least:
        reached = f"{with_unit(largest, 'N', 2)} at {with_unit(float(pressure[-1]), 'Pa', 3)}"
        raise StageError("ramp", f"the muscle pulls with {reached} only; check its mounting and the rest length")
    stopped = largest >= 0.98 * bounds.tension
    top = float(np.mean(pressure[-5:])) * (0.97 if stopped else 1.0)
    top = min(top, bounds.pressure)
    return dataclasses.replace(known, top=top, largest=largest, slack=max(known.slack, 0.015 * largest))


def part_of(record: Recording, label: str, stage: str) -> Recording:
    """Samples of the step of a label; raises `StageError` where the recording of the stage has none."""
    try:
        return record.segments(label)[0]
    except (InputError, IndexError):
        raise StageError(stage, f"its recording has no samples of the step {label!r}") from None


def seat_of(record: Recording, bounds: Bounds) -> Estimate:
    """Span at which the vented muscle gets taut when it is pulled longer, with its 95 % interval [m].

    The tension is a constant up to there and a rising, concave curve beyond; the interval is that of its likelihood. Where
    the tension does not rise the value is NaN, and the interval is open above the longest span.
    """
    pull = part_of(record, "pull", "seat")
    span, tension, rest = pull["span"], pull["tension"], bounds.rest_length
    spans = np.linspace(span[0], span[-1], 241)[:-4]
    costs = np.array([_onset_cost(span, tension, float(x), ONSET * rest) for x in spans])
    flat = float(np.sum((tension - tension.mean()) ** 2))
    error = SEAT_ERROR * rest
    noise = float(costs.min()) / max(len(span) - 4, 1)
    if flat - costs.min() < 25.0 * max(noise, 1e-12):  # five standard errors
        return Estimate(float("nan"), float(span[-1]) - error, float("inf"), "m")
    near = spans[costs <= costs.min() + NORMAL_QUANTILE**2 * noise]
    return Estimate(float(spans[np.argmin(costs)]), float(near[0]) - error, float(near[-1]) + error, "m")


def _onset_cost(span: np.ndarray, tension: np.ndarray, begin: float, onset: float) -> float:
    """Squares that a curve which begins to rise at a span leaves."""
    from scipy.optimize import nnls

    beyond = np.maximum(span - begin, 0.0)
    constant = np.ones_like(span)
    matrix = np.column_stack([constant, -constant, beyond / onset, -np.expm1(-beyond / onset)])
    return float(nnls(matrix, tension)[1] ** 2)


def _check_seat(seat: Estimate, bounds: Bounds) -> None:
    """Refuse a muscle that gets taut where its rest length does not say so: the sensors cannot tell a slack clamp."""
    rest, most = bounds.rest_length, bounds.rest_length_error
    measured = (
        f"its rest length of {with_unit(rest, 'm', 4)}, more than the {100.0 * most:g} % by which that may be off"
    )
    ask = "tighten the clamps, and measure the rest length at the muscle, between them"
    if seat.low > (1.0 + most) * rest:
        if math.isnan(seat.value):
            where = f"is still slack at {with_unit(seat.low, 'm', 4)}"
        else:
            where = f"gets taut at {with_unit(seat.value, 'm', 4)}"
        share = 100.0 * ((seat.low if math.isnan(seat.value) else seat.value) / rest - 1.0)
        raise StageError("seat", f"the vented muscle {where}, {share:.2g} % above {measured}; {ask}")
    if seat.high < (1.0 - most) * rest:
        share = 100.0 * (1.0 - seat.value / rest)
        taut = with_unit(seat.value, "m", 4)
        raise StageError("seat", f"the vented muscle gets taut at {taut}, {share:.2g} % below {measured}; {ask}")


def clamp_of(seat: Estimate, bounds: Bounds) -> tuple[float, float]:
    """Least and largest length by which a span may be longer than the muscle itself [m].

    The muscle gets taut at its rest length, which is known to the error of the ruler; what the span is more is the slack
    of a clamp. No sensor tells both apart: a muscle in a slack clamp has the tension of a longer one at every span and
    pressure.
    """
    ruler = bounds.rest_length_error * bounds.rest_length
    high = seat.high if math.isfinite(seat.high) else (1.0 + PULLED) * bounds.rest_length + ruler
    return seat.low - bounds.rest_length - ruler, high - bounds.rest_length + ruler


def _check_zeros(record: Recording, known: Progression) -> None:
    """Refuse a map in whose course the zero of a sensor has moved."""
    end = part_of(record, "zero", "map")
    for name, before, largest, unit in (
        ("tension", known.zero, known.largest, "N"),
        ("pressure", known.zero_pressure, known.top, "Pa"),
    ):
        most = MOST_DRIFT[name] * largest
        noise = 6.0 * float(np.std(end[name])) / math.sqrt(len(end))
        moved = float(np.mean(end[name])) - before
        if abs(moved) > most + noise:
            sensor = "load cell" if name == "tension" else "pressure sensor"
            share = f"more than {100.0 * MOST_DRIFT[name]:g} % of the largest {name}"
            raise StageError(
                "map", f"the zero of the {sensor} has moved by {with_unit(moved, unit, 3)}, {share}; let it warm up"
            )


def leak_of(record: Recording) -> Estimate:
    """Share of the pressure that the shut muscle loses per second [1/s]."""
    shut = part_of(record, "shut", "leak")
    begin = shut.time[0] + 1.0
    kept = shut.select(start=begin)
    return pressure_decay(kept.time, kept["pressure"])


def _path(record: Recording, zero_pressure: float) -> tuple[SpanPath, np.ndarray]:
    """Path of a recording at `SAMPLES` even times from its begin, and the tension as measured (n,)."""
    time = np.linspace(record.time[0], record.time[-1], SAMPLES)
    span, pressure, tension = (np.interp(time, record.time, record[n]) for n in ("span", "pressure", "tension"))
    return SpanPath(time - time[0], span, pressure - zero_pressure), tension


def _branches(
    record: Recording, bounds: Bounds, known: Progression, zero_pressure: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of lengths on both branches: rows of length, pressure and tension up, pressure and tension down, and samples."""
    rest = bounds.rest_length
    loops = [i for i in range(1, ISOBARS + 1) if known.isobars[i - 1][1] < (1.0 - LEAST_LOOP) * rest]
    rows, rising, falling = [], [], []
    period = (record.time[-1] - record.time[0]) / (SAMPLES - 1)
    count = PAIRS // len(loops)
    for i in loops:
        parts = [part_of(record, f"{way} {i}", "map") for way in ("lengthen", "shorten")]
        spans = [part["span"] for part in parts]
        low, high = max(float(s.min()) for s in spans), min(float(s.max()) for s in spans)
        if high - low < LEAST_LOOP * rest:
            continue
        lengths = np.linspace(low + ENDS[0] * (high - low), high - ENDS[1] * (high - low), count)
        read = [[_read(part, name, lengths, rest) for name in ("pressure", "tension")] for part in parts]
        places = [_times(part, lengths) for part in parts]
        taut = 0.5 * (read[0][1] + read[1][1]) - known.zero > TAUT * known.largest
        zeros = zero_pressure, known.zero
        columns = [column - zero for each in read for column, zero in zip(each, zeros, strict=True)]
        rows.append(np.column_stack([lengths, *columns])[taut])
        samples = [np.round((place - record.time[0]) / period).astype(int)[taut] for place in places]
        rising.append(samples[0])
        falling.append(samples[1])
    if not rows:
        raise StageError("map", "no loop has lengths that both branches reach; check the rest length")
    return np.concatenate(rows), np.concatenate(rising), np.concatenate(falling)


def _read(part: Recording, channel: str, lengths: np.ndarray, rest: float) -> np.ndarray:
    order = np.argsort(part["span"], kind="stable")
    branch = TensionPath(part["span"][order], part[channel][order], WINDOW * rest)
    return np.array([branch.read(float(x))[0] for x in lengths])


def _times(part: Recording, lengths: np.ndarray) -> np.ndarray:
    order = np.argsort(part["span"], kind="stable")
    times: np.ndarray = np.interp(lengths, part["span"][order], part.time[order])
    return times


def evaluate(
    records: dict[str, Recording],
    bounds: Bounds,
    known: Progression,
    *,
    laws: tuple[str, ...] | None = None,
    sizes: Mapping[str, JsonValue] | None = None,
    gain_error: float = GAIN_ERROR,
    name: str = "muscle",
) -> Evaluation:
    """Evaluate the recordings of all stages.

    Args:
        records: by stage.
        bounds: of the characterisation.
        known: found by the stages.
        laws: to fit; all by default.
        sizes: parameters of the laws that are not fitted, by name [SI], beside the rest length.
        gain_error: standard uncertainty of the gains of load cell and pressure sensor, a share.
        name: of the points.

    Raises:
        StageError: a fit was not possible; names the stage.
    """
    records = {stage: of_muscle(record, bounds, known.zero) for stage, record in records.items()}
    zero_pressure = float(np.mean(part_of(records["seat"], "zero", "seat")["pressure"]))
    path, tension, still = _held_path(records, zero_pressure)
    rows, rising, falling = _branches(records["map"], bounds, known, zero_pressure)
    slope, stiffness = _slopes(rows, float(path.span[still][-1]), float(np.mean(path.pressure[still])), bounds)
    stretch = part_of(records["relaxation"], "stretch", "relaxation").time[0] - records["relaxation"].time[0]
    relaxation = fit_relaxation(
        path,
        tension,
        still,
        stretch=int(np.searchsorted(path.time, stretch)),
        pressure_slope=(slope, SLOPE_ERROR * abs(slope)),
        span_slope=(STICKING * stiffness, (STICKING - 1.0) * stiffness),
    )
    chain = relaxation.chain()
    path, _ = _path(records["map"], zero_pressure)
    try:
        friction = fit_branches(path, rising, falling, rows[:, 2] - rows[:, 4], relaxation=chain)
    except InputError as error:
        raise StageError("map", f"its friction could not be fitted: {error}") from None
    beside = _beside(path, friction, relaxation)
    static = 0.5 * (rows[:, 2] + rows[:, 4]) - 0.5 * (beside[rising] + beside[falling])
    taut = static > TAUT * known.largest
    points = ForceMap(name, rows[taut, 0], 0.5 * (rows[taut, 1] + rows[taut, 3]), static[taut])
    points = points.with_rest_length(bounds.rest_length)
    skipped: dict[str, str] = {}
    rest, volume = bounds.rest_length, rest_volume(points, bounds)
    known_sizes: dict[str, JsonValue] = {"rest_length": rest, "upper_length": LONGEST * rest}
    known_sizes |= ({} if volume is None else {"rest_volume": volume}) | dict(sizes or {})
    fits = fit_all(points, laws=laws or tuple(LAWS), known=known_sizes, schemes=(), skipped=skipped)
    if not fits or not fits[0].converged:
        raise StageError("map", "no law could be fitted to its points")
    fits = [with_shared_errors(fits[0], bounds, gain_error, friction.middle[taut]), *fits[1:]]
    held_out = _held_out(records["held-out"], zero_pressure, known.zero, fits[0], friction, relaxation)
    errors = np.array([p.predicted - p.measured for p in held_out])
    seat = seat_of(records["seat"], bounds)
    return Evaluation(
        points=points,
        fits=tuple(fits),
        skipped=skipped,
        friction=friction,
        relaxation=relaxation,
        leak=leak_of(records["leak"]) if "leak" in records else None,
        seat=seat,
        clamp=clamp_of(seat, bounds),
        held_out=held_out,
        half_width=half_width(errors, gain_error * known.largest, _cord_errors(fits[0], bounds)),
        largest=known.largest,
        gain_change=gain_change(records, bounds, known),
        lengths=(min(length for _, length in known.isobars), bounds.rest_length),
    )


def of_muscle(record: Recording, bounds: Bounds, zero: float) -> Recording:
    """A recording whose spans are lengths of the muscle alone, less what a known cord stretches at rest.

    Args:
        record: of the rig.
        bounds: whose cord it is.
        zero: reading of the load cell without tension [N].
    """
    if bounds.cord is None:
        return record
    stretch = np.asarray(bounds.cord.stretch(np.maximum(record["tension"] - zero, 0.0)))
    return record.with_channels({"span": record.channels["span"].with_values(record["span"] - stretch)})


def _cord_errors(fit: Fit, bounds: Bounds) -> np.ndarray:
    """Standard errors of a fit's tensions by what a known cord stretches more than is known (n,) [N]."""
    if bounds.cord is None:
        return np.zeros(len(fit.points))
    law, length, pressure = fit.build(), fit.points.length, fit.points.pressure
    longer = length + CORD_ERROR * np.asarray(bounds.cord.stretch(fit.points.tension))
    return np.asarray(law.braid_tension(longer, pressure) - law.braid_tension(length, pressure))


def with_shared_errors(fit: Fit, bounds: Bounds, gain_error: float, friction: np.ndarray) -> Fit:
    """A fit whose intervals know of errors that all points share, and that points beside each other err alike.

    With J the derivatives of the tension, G = (J'J)^-1 J' and S the covariance of the points' errors, that of the
    parameters is G S G'. S has what the fit leaves, widened for neighbours, and one direction each for the gains of load
    cell and pressure sensor, the rest length and the stretch of a cord, and those of the friction's mean over both branches
    (n, p) [N]. Residuals alone put all four parameters of a law outside of their intervals in three of three runs.
    """
    problem = Problem(fit.law, tuple(fit.parameters), dict(fit.known), fit.points)
    place = np.array([e.value for e in fit.parameters.values()]) / problem.scale
    force, slopes = problem.functions()
    law, points, rest = fit.build(), fit.points, bounds.rest_length
    tension = np.asarray(law.braid_tension(points.length, points.pressure))
    shared = [
        gain_error * tension,
        np.asarray(law.braid_tension(points.length, points.pressure * (1.0 + gain_error))) - tension,
        _cord_errors(fit, bounds),
        *friction.T,
    ]
    if "rest_length" in fit.known:  # as the ruler has it: even over its errors up to the largest
        off = rest * bounds.rest_length_error / math.sqrt(3.0)
        longer = Problem(fit.law, problem.free, {**fit.known, "rest_length": rest + off}, points)
        shared.append(longer.functions()[0](place) - force(place))
    left = force(place) - points.tension
    to_parameters = np.linalg.pinv(slopes(place), rcond=1e-12)
    freedom = max(len(points) - len(place), 1)
    noise = float(left @ left) / freedom * widening([left]) ** 2
    covariance = noise * to_parameters @ to_parameters.T
    for one in shared:
        off = to_parameters @ np.nan_to_num(one)
        covariance = covariance + np.outer(off, off)
    half = NORMAL_QUANTILE * np.sqrt(np.diag(covariance)) * problem.scale
    wider = {
        name: e._replace(low=min(e.low, e.value - h), high=max(e.high, e.value + h))
        for (name, e), h in zip(fit.parameters.items(), half.tolist(), strict=True)
    }
    return dataclasses.replace(fit, parameters=wider)


def gain_change(records: dict[str, Recording], bounds: Bounds, known: Progression) -> Estimate:
    """Share by which the tensions of a loop have changed from the map to its repetition at the end, with its 95 % interval.

    At a length l of a branch, and at equal readings of the pressure, the tension has changed by

        T'(l) - T(l) = g T(l) + a exp(-t/3 s) + b exp(-t/15 s) +- c

    with the time t since the begin of the loop. The exponentials are what is left of the relaxation from before, since the
    muscle was stretched in another way; c is friction, of opposite sign on the branches. g is a gain of the load cell or
    of the pressure sensor that has changed, or a muscle that has.

    Args:
        records: by stage.
        bounds: of the characterisation.
        known: found by the stages.

    Returns:
        NaN with an open interval where the loops have no lengths in common.
    """
    first, last = records["map"], records["held-out"]
    near = known.again + 1 if known.again < ISOBARS else known.again - 1
    loops = [_loop(first, str(known.again)), _loop(last, AGAIN), _loop(first, str(near))]
    ends = [(float(part["span"].min()), float(part["span"].max())) for loop in loops for part in loop]
    low, high = max(a for a, _ in ends), min(b for _, b in ends)
    if high - low < LEAST_LOOP * bounds.rest_length:
        return Estimate(float("nan"), -float("inf"), float("inf"), "1")
    lengths = np.linspace(low + ENDS[0] * (high - low), high - ENDS[1] * (high - low), PAIRS // ISOBARS)
    read = [
        np.array([[_read(part, name, lengths, bounds.rest_length) - zero for part in loop] for name, zero in zeros])
        for loop, zeros in zip(loops, map(_zeros, (first, last, first)), strict=True)
    ]  # of each loop the tension and the pressure (2, branches, lengths)
    mean, above = read[0].mean(axis=1), read[2].mean(axis=1)
    slope = (above[0] - mean[0]) / (above[1] - mean[1])
    change = np.ravel(read[1][0] - read[0][0] - slope * (read[1][1] - read[0][1]))
    shorten, lengthen = loops[1][1], loops[1][0]
    times = np.concatenate([_times(part, lengths) for part in (lengthen, shorten)]) - shorten.time[0]
    signs = np.repeat([1.0, -1.0], len(lengths))
    matrix = np.column_stack([np.tile(mean[0], 2), *(np.exp(-times / t) for t in MEMORIES), signs])
    solution = np.linalg.lstsq(matrix, change, rcond=None)[0]
    names = ("gain", *(f"memory {t:g} s" for t in MEMORIES), "friction")
    spread = uncertainty(matrix, matrix @ solution - change, names)
    half = float(spread.quantile * spread.standard_error[0])
    return Estimate(float(solution[0]), float(solution[0]) - half, float(solution[0]) + half, "1")


def _loop(record: Recording, name: str) -> list[Recording]:
    return [part_of(record, f"{way} {name}", "held-out") for way in ("lengthen", "shorten")]


def _zeros(record: Recording) -> list[tuple[str, float]]:
    """Channels of tension and pressure with their readings at the end, vented and slack."""
    end = part_of(record, "zero", "held-out")
    return [(name, float(np.mean(end[name]))) for name in ("tension", "pressure")]


def rest_volume(points: ForceMap, bounds: Bounds) -> float | None:
    """Gas volume at the rest length of the ideal braid with the growth of a map's tensions [m^3]; None where it has none.

    The tension per pressure is the volume's derivative to the length. That of an ideal braid is a - b L^2, which determines
    its thread length and turns, and so its volume, whose constant laws of the tension alone leave open. Rubber and walls,
    whose tension does not grow with the pressure, are in the other terms.
    """
    length, pressure, rest = points.length / bounds.rest_length, points.pressure, bounds.rest_length
    matrix = np.column_stack([np.ones(len(length)), length, length**2, pressure * length**2, -pressure])
    size = np.linalg.norm(matrix, axis=0)
    square, constant = (np.linalg.lstsq(matrix / size, points.tension, rcond=None)[0] / size)[3:]
    if square <= 0.0 or 3.0 * constant <= square:
        return None
    thread, turns = rest * math.sqrt(3.0 * constant / square), rest * math.sqrt(3.0 / (4.0 * math.pi * square))
    return float(braid.volume(rest, thread_length=thread, turns=turns))


def _slopes(rows: np.ndarray, length: float, pressure: float, bounds: Bounds) -> tuple[float, float]:
    """Tension per pressure [m^2] and per length [N/m] of a map near a length and a pressure."""
    at, under = (rows[:, 0] - length) / bounds.rest_length, 0.5 * (rows[:, 1] + rows[:, 3]) / pressure - 1.0
    tension = 0.5 * (rows[:, 2] + rows[:, 4])
    weight = np.exp(-0.5 * ((at / 0.03) ** 2 + (under / 0.3) ** 2))
    matrix = np.column_stack([np.ones(len(at)), at, under, at * under, at**2]) * weight[:, None]
    solution = np.linalg.lstsq(matrix, tension * weight, rcond=None)[0]
    return float(solution[2]) / pressure, max(float(solution[1]) / bounds.rest_length, 0.0)


def _held_path(records: dict[str, Recording], zero_pressure: float) -> tuple[SpanPath, np.ndarray, np.ndarray]:
    """Path of the stage with the stretch, the tension along it [N], and which samples are of the hold, (n,)."""
    record = records["relaxation"]
    path, tension = _path(record, zero_pressure)
    begin = part_of(record, "hold", "relaxation").time[0] - record.time[0] + SETTLED
    return path, tension, path.time >= begin


def relaxation_curve(records: dict[str, Recording], found: Evaluation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time since the stretch [s], tension while the span stands still, measured and fitted [N], (n,) each."""
    path, tension, still = _held_path(records, 0.0)
    chain = found.relaxation.chain()
    fitted = np.zeros(SAMPLES) if chain is None else relaxation_force(path, chain)
    fitted = fitted + np.mean((tension - fitted)[still])
    return path.time[still] - path.time[still][0], tension[still], fitted[still]


def half_width(errors: np.ndarray, gain_error: float = 0.0, cord: np.ndarray | None = None) -> float:
    """Half width of the 95 % interval of a predicted tension [N].

    Args:
        errors: of points that no fit has seen (n,) [N].
        gain_error: standard error of the largest tension by the gain of one sensor; there are two [N].
        cord: standard errors of tensions by the stretch of a cord, of which the largest counts [N].
    """
    from scipy.special import stdtrit

    stretched = 0.0 if cord is None else float(np.max(np.abs(cord)))
    return float(stdtrit(len(errors), 0.975) * np.sqrt(np.mean(errors**2) + 2.0 * gain_error**2 + stretched**2))


def _beside(path: SpanPath, friction: BranchFit, relaxation: RelaxationFit) -> np.ndarray:
    force = friction_force(path, friction.friction())
    chain = relaxation.chain()
    return force if chain is None else force + relaxation_force(path, chain)


def _held_out(
    record: Recording, zero_pressure: float, zero: float, fit: Fit, friction: BranchFit, relaxation: RelaxationFit
) -> tuple[HeldOut, ...]:
    path, _ = _path(record, zero_pressure)
    beside, law, points = _beside(path, friction, relaxation), fit.build(), []
    for step in record.meta["steps"]:
        if not str(step["label"]).startswith("point "):
            continue
        part = record.select(start=step["end"] - READ, end=step["end"])
        length, pressure = float(np.mean(part["span"])), float(np.mean(part["pressure"])) - zero_pressure
        at = float(np.mean(part.time)) - record.time[0]
        force = float(law.braid_tension(length, pressure)) + float(np.interp(at, path.time, beside))
        points.append(HeldOut(length, pressure, float(np.mean(part["tension"])) - zero, max(force, 0.0)))
    if not points:
        raise StageError("held-out", "its recording has no held-out points")
    return tuple(points)


def specimen_of(found: Evaluation, bounds: Bounds, *, name: str, title: str) -> Specimen:
    """The fitted muscle as a specimen: law, friction, relaxation and leak with their intervals."""
    spec = fitted_specimen(found.fits[:1], name=name)
    numbers = spec.laws[found.fits[0].law]
    if "rest_volume" in numbers:
        note = "of the ideal braid with these tensions; no reading shows it"
        numbers["rest_volume"] = dataclasses.replace(numbers["rest_volume"], inferred=True, note=note)
    error = found.half_width
    taut = f"; taut at {with_unit(found.seat.value, 'm', 4)}" if math.isfinite(found.seat.value) else ""
    lengths = "spans, with clamps and tendon"
    if bounds.cord is not None:
        stiffness = with_unit(float(bounds.cord.stiffness), "N/m", 3)
        lengths = f"spans, with clamps, less what cord and frame stretch, {stiffness}"
    note = f"as measured, to {100.0 * bounds.rest_length_error:g} %{taut}; lengths are {lengths}"
    properties = {
        "rest_length": SpecimenNumber(value=bounds.rest_length, unit="m", note=note),
        **measured_range(found.points, found.lengths),
        "tension_uncertainty": SpecimenNumber(
            value=error, unit="N", note="half width of the 95 % interval of a predicted tension, from held-out points"
        ),
    }
    chain = found.relaxation.chain()
    if chain is not None:
        total = found.relaxation.total
        note = f"fitted; {total.low:.4g} to {total.high:.4g} N/m relax from 1 s to 30 s after a step of the length, at 95 %"
        properties["creep_stiffness"] = SpecimenNumber(
            value=[float(k) for k in np.asarray(chain.stiffness)], unit="N/m", note=note
        )
        properties["creep_time_constants"] = SpecimenNumber(
            value=[float(t) for t in np.asarray(chain.time_constant)], unit="s", note="of the Maxwell elements"
        )
    if found.leak is not None:
        properties["leak_decay"] = SpecimenNumber(
            value=found.leak.value,
            unit="1/s",
            range=(found.leak.low, found.leak.high),
            note="share of the pressure lost per second, shut off",
        )
    return dataclasses.replace(
        spec, title=title, properties=properties, friction={"maxwell_slip": _friction_numbers(found.friction)}
    )


def _friction_numbers(fit: BranchFit) -> dict[str, SpecimenNumber]:
    def number(value: float, unit: str, ends: tuple[float, float] | None = None, note: str = "fitted") -> Any:
        return SpecimenNumber(value=value, unit=unit, range=ends, note=note)

    p = fit.parameters
    longest = p["shortest"].value * p["spread"].value
    return {
        "constant": number(p["constant"].value, "N", (p["constant"].low, p["constant"].high)),
        "per_pressure": number(p["per_pressure"].value, "m^2", (p["per_pressure"].low, p["per_pressure"].high)),
        "elements": number(float(ELEMENTS), "1", note="chosen"),
        "shortest": number(p["shortest"].value, "m", (p["shortest"].low, p["shortest"].high)),
        "longest": number(longest, "m"),
        "at_pressure": number(AT_PRESSURE, "Pa", note="at which the travels are meant"),
    }


def muscle_of(found: Evaluation, spec: Specimen) -> Muscle:
    """The fitted muscle with friction and relaxation."""
    return Muscle(found.fits[0].build(), found.friction.friction(), found.relaxation.chain(), specimen=spec)
