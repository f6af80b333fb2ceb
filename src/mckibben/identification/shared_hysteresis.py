"""One friction with memory and one creep of several muscles, from recordings of their tension in motion.

The law is fitted to static points first. A recording then says what friction and creep add to it along a path,

    F = F_law(L + d, P') + f(z) + sum k_i e_i + c,      both driven by the motion of the braid, d(L - u)

with d the error of the set length that the fit of the law found, u what the ends have settled (of a law with a seat), f
Bouc and Wen's friction, and k_i Maxwell elements of equal stiffness. A muscle between fixed anchors moves its braid by the
settling of its ends alone. What friction does to the settling itself is of second order and left out. What only length and
pressure tell is no friction but an error of the law: c is, for each muscle, a zero and a gain of the tension, slopes over
length and pressure, and what errors of the fitted parameters and of the length do, found with the rest. It also holds the
creep from before a recording that begins under pressure, whose first 2 mm of path only tell the friction how it
began. A muscle that is slack between its anchors is as long as it is without a load. A recording may have gaps, and
begins anew after each.

Of all forms of friction (constant, in proportion to the pressure, both), with creep and without, and of none at all,
Akaike's criterion chooses: of those within 2 of the least, which it does not tell apart, the one with fewest parameters.
Samples of a recording follow one another, so that it counts as many as would be independent, and intervals are as much
wider. Errors of the law that last for a whole recording are not in this count: recordings that are held back in turn
say what the choice predicts.
Range: creep between a tenth of a second and ten seconds; friction as far as the muscle moves more than its contact yields.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .._jax import Array, Scalar, jax, jnp
from ..answers import Column, Table, brief, estimates
from ..documents import JsonValue
from ..errors import InputError
from ..estimation import INDIFFERENT, Estimate, Estimation, Parameter, akaike, misfit, uncertainty, widening
from ..formats.labels import quantity_of
from ..muscles.elements import MaxwellChain
from ..muscles.hysteresis import BoucWen, FrictionLimit
from ..muscles.law import TensionLaw
from ..muscles.laws import law_type
from ..muscles.laws.seated_braid import SeatedLaw
from ..quantities import declared, with_unit
from ..recordings import Recording
from ..recordings.files import understand
from ..specimens import SpecimenNumber
from .problem import SAME_LENGTH, FittedLaw

Source = Recording | str | os.PathLike[str]

ELEMENTS, SHORTEST, LONGEST = 3, 0.1, 10.0  # of the Maxwell elements [s]
# A parameter that is not free has its lower bound, which no sensor resolves.
PARAMETERS = {
    "constant": Parameter(1.0, 1e-3, 50.0, "N", search="log"),
    "per_pressure": Parameter(1e-5, 1e-9, 2e-4, "m^2", search="log"),
    "stiffness": Parameter(1e4, 1e2, 1e7, "N/m", search="log"),
    "creep": Parameter(1e3, 1e-2, 1e6, "N/m", search="log"),
}
NAMES = tuple(PARAMETERS)
START, LOW, HIGH = (np.array([getattr(p, end) for p in PARAMETERS.values()]) for end in ("start", "low", "high"))
MEANINGS = {
    "constant": "friction without pressure",
    "per_pressure": "friction per gauge pressure",
    "stiffness": "stiffness of the contact",
    "creep": "stiffness of all creep elements",
}
FRICTIONS = {
    "": (),
    "constant friction": ("constant", "stiffness"),
    "friction in proportion to the pressure": ("per_pressure", "stiffness"),
    "friction that grows with the pressure": ("constant", "per_pressure", "stiffness"),
}
SAMPLES = 400  # of each recording whose tension counts; more of them say the same
STEP, MOST = 2e-5, 4000  # motion between samples of a path, far below that of a contact [m]; samples of a path at most
FORGOTTEN, SHARE = 2e-3, 0.1  # path after which friction knows no more how it began [m], or share of the whole path
FEWEST = 20  # of them with tension
TAUT = 0.01  # share of the largest tension of the table below which a muscle counts as slack
FOLDS = 3  # of recordings that are held back in turn
BEYOND = 0.02  # share of its rest length by which a recording may leave the lengths of the table
LEAST_MOTION = 2e-5  # of a braid along a recording; less tells nothing of what resists it [m]
OPEN = 100.0  # upper end of an interval over the value from which on the data say nothing
EVALUATIONS = 60
LENGTH_STEP, PARAMETER_STEP = 1e-5, 1e-4  # of derivatives: of a length [m], and share of a parameter
LEAST_PRESSURE, LEVELS = 2e4, 24  # above which a slack muscle has a free length [Pa], and pressures at which it is read
BEGUN = 0.02  # share of the largest pressure of the table above which a recording begins in the middle of something
GAP = 10.0  # steps of the clock from which on a recording has a gap, in which nobody knows how the muscle moved
RANK = 1e-6  # share below which columns are one
NOTHING = "neither friction nor creep"


class BraidPath(NamedTuple):
    """Tension of the law [N], motion of the braid since the sample before [m], pressure [Pa], duration [s]; (n,) each."""

    tension: np.ndarray
    moved: np.ndarray
    pressure: np.ndarray
    duration: np.ndarray


def braid_path(law: TensionLaw, length: np.ndarray, pressure: np.ndarray, time: np.ndarray) -> BraidPath:
    """Path of a braid: as the muscle moves, less what its ends settle where the law has a seat.

    Args:
        law: of the muscle.
        length: of the muscle, (n,) [m].
        pressure: gauge pressure (n,) [Pa].
        time: of the samples, (n,) [s].
    """
    settled = np.zeros(len(length))
    if isinstance(law, SeatedLaw):
        settled = np.asarray(law.take_up(jnp.asarray(length), jnp.asarray(pressure)))
    moved = np.diff(
        np.asarray(length) - settled, prepend=length[0]
    )  # it begins unloaded, with ends that have not settled
    duration = np.maximum(np.diff(time, prepend=time[0]), 0.0)
    return BraidPath(np.asarray(law.tension(length, pressure)), moved, np.asarray(pressure), duration)


def braid_length(law: TensionLaw, length: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Length of a muscle between its anchors (n,) [m]: where it is slack, as long as it is without a load.

    Args:
        law: of the muscle.
        length: between the anchors, (n,) [m].
        pressure: gauge pressure (n,) [Pa].
    """
    slack = (np.asarray(law.tension(length, pressure)) <= 0.0) & (pressure > LEAST_PRESSURE)
    if not slack.any():
        return length
    levels = np.linspace(LEAST_PRESSURE, float(pressure.max()), LEVELS)
    free = np.array([float(law.free_length(level)) for level in levels])
    return np.where(slack, np.maximum(length, np.interp(pressure, levels, free)), length)


def resistance(values: np.ndarray, path: BraidPath) -> np.ndarray:
    """Force of friction and creep along a path (n,) [N].

    Args:
        values: friction without pressure [N] and per pressure [m^2], stiffness of the contact and of all elements [N/m].
        path: of the braid, from rest.
    """
    return np.asarray(_compiled()[0](jnp.asarray(values), path.moved, path.pressure, path.duration))


def _force(values: Array, moved: Array, pressure: Array, duration: Array) -> Array:
    constant, per_pressure, stiffness, creep = values
    friction = BoucWen(limit=FrictionLimit(constant=constant, per_pressure=per_pressure), stiffness=stiffness)
    chain = MaxwellChain.geometric(stiffness=creep, shortest=SHORTEST, longest=LONGEST, elements=ELEMENTS)

    def step(carry: Any, now: Any) -> Any:
        contact, springs, before = carry
        dx, at, dt = now
        contact = friction.advance(contact, dx, start_pressure=before, end_pressure=at, duration=dt).state
        springs = chain.advance(springs, dx, duration=dt).state
        return (contact, springs, at), friction.force(contact, pressure=at) + chain.force(springs)

    start = friction.initial() + 0.0 * constant, chain.initial() + 0.0 * creep, pressure[0]
    forces: Array = jax.lax.scan(step, start, (moved, pressure, duration))[1]
    return forces


@functools.cache
def _compiled() -> tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any]]:
    """Force along one path and along several (m, n), and its derivatives by the logarithms of the values (m, n, 4)."""
    several = jax.vmap(_force, in_axes=(None, 0, 0, 0))
    slopes = jax.jacfwd(lambda logs, *paths: several(jnp.exp(logs), *paths))
    return jax.jit(_force), jax.jit(several), jax.jit(slopes)


class ResistanceProblem:
    """Friction and creep of several paths, by least squares of what the law leaves of the tension.

    Args:
        paths: of the braids.
        left: measured tension less that of the law, (n,) of each path [N].
        used: which samples count, bool (n,) of each path.
        basis: errors of the law that only length and pressure tell, (n, k) of each path, whose size is fitted with the
            parameters for each of `groups`; None for none.
        groups: number of the muscle of each path.
        high: upper bounds of the four values; `HIGH` by default.
    """

    def __init__(
        self,
        paths: Sequence[BraidPath],
        left: Sequence[np.ndarray],
        used: Sequence[np.ndarray],
        *,
        basis: Sequence[np.ndarray] | None = None,
        groups: Sequence[int] = (),
        high: np.ndarray = HIGH,
    ) -> None:
        count = max(len(path.moved) for path in paths)
        self.steps = tuple(
            np.stack([_padded(np.asarray(path[i]), count, edge=i == 2) for path in paths]) for i in (1, 2, 3)
        )
        self.left = np.stack([_padded(values, count) for values in left])
        self.used = np.stack([_padded(keep, count) for keep in used]).astype(bool)
        self.basis = None if basis is None else np.stack([_padded(columns, count) for columns in basis])
        self.groups = np.asarray(groups)
        self.low, self.high = np.log(LOW), high
        # how many of the columns of each muscle's basis the data tell apart
        self.nuisances = 0
        for group in np.unique(self.groups):
            if self.basis is None:
                break
            own = self.groups == group
            columns = self.basis[own][self.used[own]]
            columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
            self.nuisances += int(np.linalg.matrix_rank(columns, tol=RANK))

    def without(self, paths: np.ndarray) -> ResistanceProblem:
        """The problem that does not see some of the paths, bool (paths,); compiled functions are shared."""
        other = object.__new__(ResistanceProblem)
        other.__dict__.update(self.__dict__)
        other.used = self.used & ~paths[:, None]
        return other

    def force(self, logs: np.ndarray) -> np.ndarray:
        """Force of friction and creep along all paths (paths, n) [N]."""
        return np.asarray(_compiled()[1](np.exp(logs), *self.steps))

    def common(self, error: np.ndarray) -> np.ndarray:
        """The part of errors (paths, n) that is one of the law's, by least squares at the used samples, (paths, n)."""
        part = np.zeros(error.shape)
        if self.basis is None:
            return part
        for group in np.unique(self.groups):
            own = self.groups == group
            columns, used = self.basis[own], self.used[own]
            size = np.maximum(np.linalg.norm(columns[used], axis=0), 1e-300)
            part[own] = (columns / size) @ np.linalg.lstsq(columns[used] / size, error[own][used], rcond=RANK)[0]
        return part

    def misfit(self, logs: np.ndarray) -> np.ndarray:
        """Prediction less measurement at the used samples [N]."""
        error = self.force(logs) - self.left
        return np.asarray((error - self.common(error))[self.used])

    def derivative(self, logs: np.ndarray, free: Sequence[int]) -> np.ndarray:
        """Derivative of `misfit` by the logarithms of free values (used, free) [N]."""
        whole = np.asarray(_compiled()[2](logs, *self.steps))[..., list(free)]
        return np.stack([(whole[..., i] - self.common(whole[..., i]))[self.used] for i in range(len(free))], axis=1)

    def fit(self, names: Sequence[str], starts: Sequence[np.ndarray] = (START,)) -> np.ndarray:
        """Values (4,) by least squares, in their logarithms; those that are not among `names` have their lower bound.

        Args:
            names: of the values that are fitted.
            starts: values to begin at; the best solution counts.
        """
        free = [NAMES.index(name) for name in names]
        if not free:
            return np.array(LOW)

        def whole(x: np.ndarray) -> np.ndarray:
            logs = np.array(self.low)
            logs[free] = x
            return logs

        parameters = {n: PARAMETERS[n]._replace(high=self.high[i]) for n, i in zip(names, free, strict=True)}
        estimation = Estimation(
            parameters,
            lambda x: self.misfit(whole(x)),
            lambda x: self.derivative(whole(x), free),
            margin=1e-6,
            options={"max_nfev": EVALUATIONS},
        )
        return np.asarray(np.exp(whole(estimation.search(np.log(start)[free] for start in starts).x)))

    def errors(self, values: np.ndarray | None) -> list[np.ndarray]:
        """Prediction less measurement at the used samples of each path [N]; by the law alone for None."""
        error = (0.0 if values is None else self.force(np.log(values))) - self.left
        error = error - self.common(error)
        return [row[keep] for row, keep in zip(error, self.used, strict=True)]

    def intervals(self, values: np.ndarray, names: Sequence[str]) -> dict[str, Estimate]:
        """Values with their 95 % intervals, from derivatives by their logarithms, wider as samples depend on each other."""
        free = [NAMES.index(name) for name in names]
        if not free:
            return {}
        errors = self.errors(values)
        spread = uncertainty(self.derivative(np.log(values), free), np.concatenate(errors), tuple(names))
        width = spread.quantile * spread.standard_error * widening(errors)
        estimates = {}
        with np.errstate(over="ignore"):
            for name, i, w in zip(names, free, width, strict=True):
                low, high = values[i] * np.exp(-w), values[i] * np.exp(w)
                estimates[name] = Estimate(float(values[i]), float(low), float(high), PARAMETERS[name].unit)
        return estimates


def _padded(values: np.ndarray, count: int, *, edge: bool = False) -> np.ndarray:
    """Values (n, ..) with as many zeros, or last values, behind them that there are `count`."""
    width = [(0, count - len(values)), *[(0, 0)] * (values.ndim - 1)]
    return np.pad(values, width, mode="edge" if edge else "constant")


def independent_samples(errors: Sequence[np.ndarray]) -> int:
    """How many of the samples of paths, whose errors follow one another, count as independent."""
    return -(-sum(map(len, errors)) // max(round(widening(errors) ** 2), 1))


@dataclass(frozen=True)
class HysteresisModel:
    """One candidate: its words, the names of what it frees, what it leaves [N], and Akaike's criterion."""

    title: str
    free: tuple[str, ...]
    rmse: float
    aicc: float

    __repr__ = brief


@dataclass(frozen=True, repr=False)
class SharedHysteresis:
    """Friction with memory and creep that several muscles share, as far as the data show either.

    Attributes:
        title: the form that Akaike's criterion chose, such as ``constant friction and creep``.
        parameters: ``constant`` [N], ``per_pressure`` [m^2], ``stiffness`` and ``creep`` [N/m], those that were chosen.
        models: all forms that were fitted, that with the least AICc first.
        muscles: rest lengths of the muscles that were recorded [m]; one NaN where the table has none.
        recordings: names of the recordings.
        samples: that were fitted, all with tension.
        independent: samples that count as independent of each other.
        rmse: what law and choice leave of them [N], beside errors of the law of each muscle.
        law_rmse: what the law alone leaves, with the same [N].
        uncorrected_rmse: what the law leaves without these [N].
        held_back: error of recordings that were held back, by the choice and by the law alone [N]; None for one recording.
        warnings: as text.
    """

    title: str
    parameters: dict[str, Estimate]
    models: tuple[HysteresisModel, ...]
    muscles: tuple[float, ...]
    recordings: tuple[str, ...]
    samples: int
    independent: int
    rmse: float
    law_rmse: float
    uncorrected_rmse: float
    held_back: tuple[float, float] | None
    warnings: tuple[str, ...] = ()

    @property
    def friction(self) -> BoucWen | None:
        """The friction that was found; None where the data show none."""
        value = {name: e.value for name, e in self.parameters.items()}
        if "stiffness" not in value:
            return None
        limit = FrictionLimit(constant=value.get("constant", 0.0), per_pressure=value.get("per_pressure", 0.0))
        return BoucWen(limit=limit, stiffness=value["stiffness"])

    @property
    def creep(self) -> MaxwellChain | None:
        """The Maxwell elements that were found; None where the data show no creep."""
        if "creep" not in self.parameters:
            return None
        total = self.parameters["creep"].value
        return MaxwellChain.geometric(stiffness=total, shortest=SHORTEST, longest=LONGEST, elements=ELEMENTS)

    def is_open(self, name: str) -> bool:
        """Whether the data leave a parameter open: its interval reaches a hundred times its value."""
        e = self.parameters[name]
        return not e.high <= OPEN * e.value

    def has(self, words: str) -> bool:
        """Whether ``friction`` or ``creep`` was chosen."""
        return (self.friction if words == "friction" else self.creep) is not None

    def difference(self, words: str) -> float:
        """AICc of the best form without ``friction`` or ``creep`` less that of the best with it; positive where it pays."""
        key = "creep" if words == "creep" else "stiffness"
        with_it, without = (min(m.aicc for m in self.models if (key in m.free) == has) for has in (True, False))
        return without - with_it

    def __repr__(self) -> str:
        return f"SharedHysteresis({self.title!r}, {len(self.recordings)} recordings, rmse {self.rmse:.3g} N)"

    def to_dict(self) -> dict[str, JsonValue]:
        """Parameters with their intervals, all forms and errors [N] as plain values [SI], for JSON."""
        return {
            "title": self.title,
            "parameters": {name: e._asdict() for name, e in self.parameters.items()},
            "models": [{"title": m.title, "free": list(m.free), "rmse": m.rmse, "aicc": m.aicc} for m in self.models],
            "muscles": [r if np.isfinite(r) else None for r in self.muscles],
            "recordings": list(self.recordings),
            "samples": self.samples,
            "independent": self.independent,
            "rmse": self.rmse,
            "law_rmse": self.law_rmse,
            "uncorrected_rmse": self.uncorrected_rmse,
            "held_back": None if self.held_back is None else list(self.held_back),
            "warnings": list(self.warnings),
        }

    def tables(self) -> list[Table]:
        """The forms that were fitted, and the parameters of the chosen one with what they predict below."""
        muscles, least = len(self.muscles), self.models[0].aicc
        title = (
            f"friction and creep, from {len(self.recordings)} recording{'s' * (len(self.recordings) > 1)} of "
            f"{muscles} muscle{'s' * (muscles > 1)}: {self.samples} samples, {self.independent} of them independent"
        )
        forms = [
            {"title": m.title, "free": len(m.free), "rmse": m.rmse, "aicc": m.aicc, "above": m.aicc - least}
            for m in self.models
        ]
        numbers = (Column("rmse", unit="N", places=".3g", beside=True), Column("aicc", "AICc", "1", places=".1f"))
        above = Column("above", "above the least", "1", places="+.1f")
        said = []
        for part in ("friction", "creep"):
            if not self.has(part):
                more = -self.difference(part)
                how = f"{more:.1f} higher" if more > 0.0 else f"only {-more:.1f} lower"
                said.append(f"no {part}: with it AICc is {how}, so that these data do not tell of it")
        said.append(
            f"Error along the recordings: {self.uncorrected_rmse:.3g} N rms by the law; {self.law_rmse:.3g} N with errors "
            f"of the law, which only length and pressure tell; {self.rmse:.3g} N with this."
        )
        if self.held_back is not None and self.parameters:
            by, alone = self.held_back
            said.append(f"Recordings held back in turn: {by:.3g} N rms, {alone:.3g} N by the law alone.")
        said += [f"note: {warning}" for warning in self.warnings]
        named = {f"{MEANINGS[name]} ({name})": e for name, e in self.parameters.items()}
        unknown = {f"{MEANINGS[name]} ({name})": "its size is not in the data" for name in self.parameters
                   if self.is_open(name)}  # fmt: skip
        return [
            Table(title, (Column("title", "form"), Column("free", right=True), *numbers, above), forms),
            estimates(self.title, named, said, more=unknown),
        ]

    def numbers(self) -> tuple[dict[str, dict[str, SpecimenNumber]], dict[str, SpecimenNumber]]:
        """Groups of friction and properties of creep, as a specimen states them."""

        def number(name: str, value: float | list[float], unit: str) -> SpecimenNumber:
            e, note = self.parameters[name], f"fitted to {len(self.recordings)} recordings"
            if isinstance(value, list):
                note += f"; together {e.low:.4g} to {e.high:.4g} N/m at 95 %"
            known = not isinstance(value, list) and not self.is_open(name)
            return SpecimenNumber(value=value, unit=unit, note=note, range=(e.low, e.high) if known else None)

        names = [name for name in self.parameters if name != "creep"]
        friction = {name: number(name, self.parameters[name].value, self.parameters[name].unit) for name in names}
        chain = self.creep
        creep = {}
        if chain is not None:
            creep = {
                "creep_stiffness": number("creep", [float(k) for k in np.asarray(chain.stiffness)], "N/m"),
                "creep_time_constants": SpecimenNumber(
                    value=[float(t) for t in np.asarray(chain.time_constant)], unit="s", note="of the Maxwell elements"
                ),
            }
        return ({"bouc_wen": friction} if friction else {}), creep


def fit_shared_hysteresis(
    fit: FittedLaw,
    recordings: Mapping[str, Recording] | Iterable[Source] | Source,
    *,
    progress: Callable[[str], None] | None = None,
) -> SharedHysteresis:
    """Fit one friction with memory and one creep to recordings of the muscles of a fitted table.

    Args:
        fit: of the law, to static points of the same muscles.
        recordings: time, gauge pressure, length or span, and tension; one muscle each, which a channel ``rest_length``
            or the metadata name where the table has several. Files, folders or patterns such as ``runs/*.csv`` are
            read; a mapping says what messages call each recording.
        progress: called with a few words after each form that was fitted.

    Raises:
        InputError: a channel is missing; a recording is of a muscle or of lengths that the table does not have; nothing in
            it moves the braid; or there is hardly any tension.
    """
    records = read_recordings(recordings)
    whole = {name: _motions(fit, record, name) for name, record in records.items()}
    pulls = {name: sum(int(m.used.sum()) for m in several) for name, several in whole.items()}
    slack = {name: n for name, n in pulls.items() if n < FEWEST}
    if len(slack) == len(whole):
        allowed = f"must pull at {FEWEST} of the samples that are fitted or more, got {max(slack.values())}"
        raise InputError("tension", None, allowed, where=next(iter(whole)))
    motions = [m for name, several in whole.items() if name not in slack for m in several if m.used.any()]
    problem = _problem(motions, fit.points.largest)
    values = _fits(problem, progress or (lambda _: None))
    models, count = _ranked(problem, values)
    alike = [model for model in models if model.aicc <= models[0].aicc + INDIFFERENT]
    best, law = min(alike, key=lambda model: len(model.free)), next(model for model in models if not model.free)
    measured = tuple(sorted({m.rest_length for m in motions}))
    notes = [
        f"no recording is of the muscle of {with_unit(r, 'm')}: it is taken to be like the others"
        for r in _muscles(fit)
        if r not in measured
    ]
    left = [f"{name} is left out: the muscle pulls at {n} of its samples only" for name, n in slack.items()]
    errors = dict(zip(map(id, motions), problem.errors(values[best.title] if best.free else None), strict=True))
    for name in (name for name in whole if name not in slack):
        own = [m for m in whole[name] if m.used.any()]
        tension = np.concatenate([m.tension[m.used] for m in own])
        left += misfit(f"the tension of {name}", tension, np.concatenate([errors[id(m)] for m in own]))
    return SharedHysteresis(
        title=best.title,
        parameters=problem.intervals(values[best.title], best.free),
        models=models,
        muscles=measured,
        recordings=tuple(name for name in whole if name not in slack),
        samples=int(problem.used.sum()),
        independent=count,
        rmse=best.rmse,
        law_rmse=law.rmse,
        uncorrected_rmse=float(np.sqrt(np.mean(problem.left[problem.used] ** 2))),
        held_back=_held_back(problem, best, law.rmse),
        warnings=(*notes, *left),
    )


def _forms() -> dict[str, tuple[str, ...]]:
    """What is fitted, in words, and the names of what each frees."""
    forms = {}
    for words, free in FRICTIONS.items():
        forms[words or NOTHING] = free
        forms[f"{words} and creep" if words else "creep"] = (*free, "creep")
    return forms


def _fits(problem: ResistanceProblem, progress: Callable[[str], None]) -> dict[str, np.ndarray]:
    """Values of each form, begun also at those of forms that it contains, and then at those of forms that contain it."""
    forms = _forms()
    order = sorted(forms, key=lambda title: len(forms[title]))
    values = {title: np.array(LOW) for title in order}
    errors = dict.fromkeys(order, np.inf)

    def descend(title: str, starts: Sequence[np.ndarray]) -> None:
        found = problem.fit(forms[title], starts)
        error = float(np.sum(problem.misfit(np.log(found)) ** 2))
        if error < errors[title]:
            values[title], errors[title] = found, error

    for title in order:
        inside = [other for other in order if forms[other] and set(forms[other]) < set(forms[title])]
        nearest = [values[min(inside, key=errors.__getitem__)]] if inside else []
        descend(title, [START, _sized(problem), *nearest])
        progress(title)
    for title in reversed(order):
        around = [other for other in order if set(forms[other]) > set(forms[title]) and forms[title]]
        if around:
            descend(title, [values[min(around, key=errors.__getitem__)]])
    return values


def _ranked(problem: ResistanceProblem, values: Mapping[str, np.ndarray]) -> tuple[tuple[HysteresisModel, ...], int]:
    """All forms by Akaike's criterion, and how many samples count as independent: by what the richest form leaves."""
    forms = _forms()
    errors = {title: problem.errors(values[title] if free else None) for title, free in forms.items()}
    count = independent_samples(errors[max(forms, key=lambda title: len(forms[title]))])
    models = []
    for title, free in forms.items():
        size = float(np.sqrt(np.mean(np.concatenate(errors[title]) ** 2)))
        criterion = akaike(np.full(count, size), len(free) + problem.nuisances + 1)
        models.append(HysteresisModel(title, free, size, criterion))
    return tuple(sorted(models, key=lambda model: (model.aicc, len(model.free)))), count


def _problem(motions: Sequence[_Motion], largest: float) -> ResistanceProblem:
    """The recordings as one problem.

    What only length and pressure tell is an error of the law, for each muscle: a zero and a gain of the tension, slopes over
    length and pressure, and what errors of the fitted parameters and of the set length do. What a recording that begins
    under pressure has crept before it, decays as the elements do.
    """
    rests = list(dict.fromkeys(m.rest_length for m in motions))
    begun = [i for i, m in enumerate(motions) if m.begun]
    times = np.geomspace(SHORTEST, LONGEST, ELEMENTS)
    basis = []
    for i, m in enumerate(motions):
        path = m.path
        earlier = np.zeros((len(m.tension), ELEMENTS * len(begun)))
        if i in begun:
            at = ELEMENTS * begun.index(i)
            earlier[:, at : at + ELEMENTS] = np.exp(-np.cumsum(path.duration)[:, None] / times)
        shape = np.ones(len(m.tension)), path.tension, m.length, path.pressure
        basis.append(np.column_stack([*shape, m.slopes, earlier]))
    return ResistanceProblem(
        [m.path for m in motions],
        [m.tension - m.path.tension for m in motions],
        [m.used for m in motions],
        basis=basis,
        groups=[rests.index(m.rest_length) for m in motions],
        high=np.maximum(HIGH, [largest, largest / 1e5, 0.0, 0.0]),
    )


def _sized(problem: ResistanceProblem) -> np.ndarray:
    """Values to begin at that are of the size of what the law leaves."""
    error = max(float(np.sqrt(np.mean((problem.left - problem.common(problem.left))[problem.used] ** 2))), 1e-3)
    travel = max(float(np.ptp(np.cumsum(problem.steps[0], axis=1), axis=1).max()), LEAST_MOTION)
    pressure = max(float(problem.steps[1].max()), 1.0)
    return np.array([error, error / pressure, 30.0 * error / travel, error / travel])


def _held_back(problem: ResistanceProblem, best: HysteresisModel, law_rmse: float) -> tuple[float, float] | None:
    """Error of recordings whose friction and creep are those of the others, and of the law alone; zeros are those of all.

    The form is the one that all recordings chose; its values, and where their search begins, are the others' alone.
    """
    count = len(problem.left)
    if count < 2:
        return None
    if not best.free:
        return law_rmse, law_rmse
    fold, errors = np.arange(count) % min(FOLDS, count), []
    for k in np.unique(fold):
        others = problem.without(fold == k)
        values = others.fit(best.free, [_sized(others), START])
        errors += [e for e, f in zip(problem.errors(values), fold, strict=True) if f == k]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2))), law_rmse


# ---- recordings


def read_recordings(
    sources: Mapping[str, Recording] | Iterable[Source] | Source, *, pressure_zero: Scalar = 0.0
) -> dict[str, Recording]:
    """Recordings by the names that messages call them.

    Args:
        sources: recordings, or files of any format, folders of them, or patterns such as ``runs/*.csv``; one or several.
        pressure_zero: what the gauge pressures in files of others read at zero [Pa]; it is subtracted.

    Raises:
        InputError: there is no such file, it is no recording, or nothing was named.
    """
    if not isinstance(sources, Iterable | os.PathLike | Recording):
        raise InputError("hysteresis", None, f"must be recordings, or their files, got {sources!r}")
    named = isinstance(sources, Mapping)
    found: dict[str, Recording] = dict(sources) if isinstance(sources, Mapping) else {}
    listed = [sources] if isinstance(sources, Recording | str | os.PathLike) else list(() if named else sources)
    for i, one in enumerate(listed, 1):
        if isinstance(one, Recording):
            title = str(one.meta.get("title", "recording"))
            found[title if title not in found else f"{title} ({i})"] = one
            continue
        for path in _files(Path(one)):
            data = understand(path, kind="recording", pressure_zero=float(pressure_zero)).data
            assert isinstance(data, Recording)
            found[str(path)] = data
    if not found:
        raise InputError("hysteresis", None, "must be at least one recording")
    return found


def _files(path: Path) -> list[Path]:
    """The files of a folder or of a pattern, sorted; else the path itself."""
    try:
        if path.is_dir():
            listed = sorted(p for p in path.iterdir() if p.is_file() and not p.name.startswith("."))
        elif not path.exists() and any(c in path.name for c in "*?["):
            listed = sorted(path.parent.glob(path.name))
        else:
            return [path]
    except (OSError, ValueError):
        return [path]
    if not listed:
        raise InputError("hysteresis", str(path), "must hold at least one recording")
    return listed


class _Motion(NamedTuple):
    """A recording on the path of its braid: length [m] and tension [N], (n,), which samples count, and the muscle.

    It has `begun` before its first sample where that is under pressure. Its `slopes` (n, k) are those of the law's tension
    over the length and the fitted parameters, each to its largest [1].
    """

    path: BraidPath
    length: np.ndarray
    tension: np.ndarray
    used: np.ndarray
    rest_length: float
    begun: bool
    slopes: np.ndarray


def _muscles(fit: FittedLaw) -> list[float]:
    rest = fit.points.rest_length
    return [] if rest is None else [float(r) for r in np.unique(np.round(rest, 9))]


def _motions(fit: FittedLaw, recording: Recording, name: str) -> list[_Motion]:
    """The pieces of a recording between its gaps, on the paths of their braid."""
    length, pressure, tension = (
        _channel(recording, quantity, unit, name)
        for quantity, unit in (("length", "m"), ("pressure", "Pa"), ("tension", "N"))
    )
    muscles = _muscles(fit)
    rest = _rest_length(recording, muscles, name)
    own = np.ones(len(fit.points), bool)
    if fit.points.rest_length is not None:
        own = np.abs(np.asarray(fit.points.rest_length) - rest) < SAME_LENGTH
    _check_lengths(length, np.asarray(fit.points.length)[own], name)
    several = len(muscles) > 1 and "rest_length" in declared(law_type(fit.law))
    law = fit.build(**({"rest_length": rest} if several else {}))
    # at a set length of the table its own error, else the mean of the muscle's
    known = [e for e in fit.length_errors if not np.isfinite(rest) or abs(e.rest_length - rest) < SAME_LENGTH]
    at = [e.added for e in known if np.abs(length - e.length).max() < SAME_LENGTH]
    length_error = at[0] if at else float(np.mean([e.added for e in known])) if known else 0.0
    durations = np.diff(recording.time)
    gaps = np.flatnonzero(durations > max(GAP * float(np.median(durations)), SHORTEST)) + 1
    pieces = []
    for part in np.split(np.arange(len(length)), gaps):
        # so many samples that the muscle hardly moves between them
        count = max(SAMPLES, min(float(np.abs(np.diff(length[part])).sum()) / STEP, MOST))
        part = part[:: max(round(len(part) / count), 1)]
        braid = braid_length(law, length[part] + length_error, pressure[part])
        path = braid_path(law, braid, pressure[part], recording.time[part])
        begun = bool(pressure[part][0] > BEGUN * float(np.max(fit.points.pressure)))
        used = _used(tension[part], path, TAUT * fit.points.largest, begun=begun)
        slopes = _slopes(fit, law, rest if several else None, braid, path)
        pieces.append(_Motion(path, length[part], tension[part], used, rest, begun, slopes))
    _check_motion(pieces, fit.law, name)
    return pieces


def _slopes(fit: FittedLaw, law: TensionLaw, rest: float | None, length: np.ndarray, path: BraidPath) -> np.ndarray:
    """What errors of the fitted parameters and of the length do to the tension of the law (n, k), each to its largest."""
    columns = [np.asarray(law.tension(length + LENGTH_STEP, path.pressure)) - path.tension]
    bounds = declared(law_type(fit.law))
    for name, e in fit.parameters.items():
        step = PARAMETER_STEP * (abs(e.value) or 1.0)
        changes = {name: e.value + (step if e.value + step <= bounds[name].bounds[1] else -step)}
        moved = fit.build(**changes | ({} if rest is None else {"rest_length": rest}))
        columns.append(np.asarray(moved.tension(length, path.pressure)) - path.tension)
    whole = np.stack(columns, axis=1)
    return np.asarray(whole / np.maximum(np.abs(whole).max(axis=0), 1e-300))


def _used(tension: np.ndarray, path: BraidPath, least: float, *, begun: bool) -> np.ndarray:
    """Which samples of a path count: under tension, `SAMPLES` of them, and after friction has forgotten how it began."""
    used = (tension > least) & (path.tension > 0.0)
    used &= np.arange(len(used)) % max(len(used) // SAMPLES, 1) == 0
    if begun:
        way = np.cumsum(np.abs(np.append(0.0, path.moved[1:])))
        used &= way >= min(FORGOTTEN, SHARE * way[-1])
    return used


def _channel(recording: Recording, quantity: str, unit: str, name: str) -> np.ndarray:
    measured = [n for n, c in recording.channels.items() if c.kind != "command" and not n.startswith("command.")]
    stems = {n: n.rpartition(".")[2] for n in measured}
    kinds = [[n for n in measured if stems[n] == word] for word in (("span", "length") if unit == "m" else (quantity,))]
    kinds.append([n for n in measured if quantity_of(stems[n]) == quantity and not n.endswith("_abs")])
    for alike in kinds:
        plain = [n for n in alike if "." not in n] or alike
        if len(plain) == 1:
            channel = recording.channels[plain[0]]
            if channel.unit != unit:
                raise InputError(plain[0], channel.unit, f"must be in {unit}", where=name)
            if not np.isfinite(channel.values).all():
                raise InputError(plain[0], None, "must be finite at every sample", where=name)
            return np.asarray(channel.values, float)
    words = "length or span" if unit == "m" else quantity
    raise InputError(words, None, f"must be one channel; the recording has {', '.join(measured)}", where=name)


def _rest_length(recording: Recording, muscles: Sequence[float], name: str) -> float:
    if not muscles:
        return float("nan")
    alike = [n for n in recording.channels if quantity_of(n.rpartition(".")[2]) == "rest_length"]
    said: Any = recording[alike[0]] if alike else recording.meta.get("rest_length")
    if said is None:
        if len(muscles) == 1:
            return muscles[0]
        known = ", ".join(with_unit(m, "m") for m in muscles)
        problem = f"is missing: a column rest_length says of which muscle the recording is, of {known}"
        raise InputError("rest_length", None, problem, where=name)
    value = float(np.median(np.asarray(said, float)))
    if np.ptp(np.asarray(said, float)) > SAME_LENGTH:
        raise InputError("rest_length", None, "must be one muscle in each recording", where=name)
    same = [m for m in muscles if abs(m - value) < SAME_LENGTH]
    if not same:
        known = ", ".join(with_unit(m, "m") for m in muscles)
        raise InputError("rest_length", with_unit(value, "m"), f"must be of a muscle of the table: {known}", where=name)
    return same[0]


def _check_lengths(length: np.ndarray, table: np.ndarray, name: str) -> None:
    margin = BEYOND * float(table.max())
    for at in (float(length.min()), float(length.max())):
        if not table.min() - margin <= at <= table.max() + margin:
            ends = f"{with_unit(float(table.min()), 'm')} and {with_unit(float(table.max()), 'm')}"
            raise InputError(
                "length", with_unit(at, "m"), f"must be between {ends}, where the table was measured", where=name
            )


def _check_motion(pieces: Sequence[_Motion], law: str, name: str) -> None:
    """Refuse a recording in which nothing moves the braid."""
    if sum(float(np.abs(piece.path.moved[1:]).sum()) for piece in pieces) >= LEAST_MOTION:
        return
    pressure, length = (
        np.concatenate(values) for values in zip(*((m.path.pressure, m.length) for m in pieces), strict=True)
    )
    reason = "nothing moves that friction and creep could resist"
    if float(np.ptp(pressure)) < 0.01 * float(np.abs(pressure).max()):
        problem = f"is {with_unit(float(pressure[0]), 'Pa', 3)} throughout, and the length does not change either"
        raise InputError("pressure", None, f"{problem}: {reason}", where=name)
    held = with_unit(float(length[0]), "m", 4)
    problem = f"is {held} throughout, and the law {law} has no ends that settle, as seated_braid has"
    raise InputError("length", None, f"{problem}: {reason}", where=name)
