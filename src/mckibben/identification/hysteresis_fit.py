"""Friction of a muscle from a loop of pressure and stroke, and how well it predicts the part that the fit did not see.

The muscle lifts a load while its pressure rises and falls slowly. Along the path, sample by sample,

    F(L, P' - P0) + f(z) + sum k_i e_i = W + K (L0 - L),      stroke = L0 - L

is solved for the length L, with F the tension law, f a friction with memory (positive while lengthening), W the load
and K a spring beside it. Maxwell elements k_i with the deflections e_i are the creep of the wall: of equal stiffness, and
with time constants from a twentieth of the record to five times its duration, so that they have one parameter, their
stiffness together. Where no law is known, a smooth monotone curve takes its place, (P' - G(stroke)) A, whose area A only
states the friction as a force. The path is run twice and the second is read: friction is then settled, and creep as far
as one loop before settles it.
Range: slow motion, so that every sample is an equilibrium. Where creep is not fitted beside it, friction takes its place.
Friction in a force balance: T. Vo-Minh, T. Tjahjowidodo, H. Ramon and H. Van Brussel, IEEE/ASME Trans. Mechatronics
16(1), 2011.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._jax import Array, Scalar, Tree, jax, jnp
from ..components import Hysteresis
from ..documents import JsonValue
from ..errors import InputError, choice
from ..estimation import Estimate, Estimation, Parameter, PartialFit, akaike, at_bounds, conclude, misfit
from ..muscles.elements import MaxwellChain
from ..muscles.hysteresis import BoucWen, Dahl, FrictionLimit, MaxwellSlip
from ..muscles.law import TensionLaw
from .discrepancy import RecordPrediction, predict_records
from .path_record import PathRecord
from .record_posterior import RecordPosterior, RecordProblem, check_converged, posterior_of_records
from .sampler import HostModel

if TYPE_CHECKING:
    from ..engine.prediction import Prediction


def _value(start: float, low: float, high: float, unit: str) -> Parameter:
    """A parameter that is searched by itself, in units of its start or a thousandth of its range."""
    return Parameter(start, low, high, unit, size=max(abs(start), 1e-3 * (high - low)))


_LIMIT = {"constant": _value(10.0, 1e-6, 1e3, "N"), "per_pressure": _value(1e-5, 0.0, 1e-3, "m^2")}
TRAVEL = {
    "shortest": Parameter(5e-4, 1e-6, 5e-2, "m", search="log"),
    "spread": Parameter(10.0, 1.0, 1e3, "1", search="log"),
}
_STIFFNESS = {"stiffness": Parameter(1e4, 1e2, 1e7, "N/m", search="log")}


def _limit(p: Mapping[str, Any]) -> FrictionLimit:
    return FrictionLimit(constant=p["constant"], per_pressure=p["per_pressure"])


# Frictions that a loop can identify. Coulomb's knows no force at rest and leaves the solved balance without a slope.
MODELS: dict[str, tuple[Callable[[Mapping[str, Any]], Hysteresis], dict[str, Parameter]]] = {
    "maxwell_slip": (
        lambda p: MaxwellSlip.geometric(
            _limit(p), elements=6, shortest=p["shortest"], longest=p["shortest"] * p["spread"]
        ),
        {**_LIMIT, **TRAVEL},
    ),
    "dahl": (lambda p: Dahl(limit=_limit(p), stiffness=p["stiffness"]), {**_LIMIT, **_STIFFNESS}),
    "bouc_wen": (
        lambda p: BoucWen(limit=_limit(p), stiffness=p["stiffness"], share=p["share"]),
        {**_LIMIT, **_STIFFNESS, "share": _value(0.6, 0.5, 20.0, "1")},
    ),
}
# Creep along a path: count of Maxwell elements, and their time constants as shares of the duration of the path.
ELEMENTS, SHORTEST, LONGEST = 3, 0.05, 5.0
# Without kinks, so that a descent finds the lowest minimum.
SMOOTH = ("dahl", "bouc_wen")


# Area by which a curve's pressure becomes a force [m^2]; near that of a 10 mm muscle, and of no effect on the stroke.
AREA = 1e-3
# Halvings of the length interval: 2^-48 of half a metre is below any rounding that matters.
HALVINGS = 48
# Every contact that starts to slip kinks the misfit, and a descent may end on a kink: the best is shaken and tried again.
# That is not always enough: with every other run of samples left out, six contacts made by hand were missed by a third,
# and the intervals, which know one minimum only, did not say so. The smooth frictions had no such trouble.
SEED, SHAKEN, SHAKE = 1, 6, 0.3


@dataclass(frozen=True)
class LoopFit(PartialFit):
    """Result of a fit of friction to a loop; errors in metres of stroke, prediction less measurement."""

    model: str
    law: bool
    parameters: dict[str, Estimate]
    known: dict[str, float]  # parameters that were not fitted [SI]
    curve: np.ndarray  # pressures of the anhysteretic curve at its knots [Pa]; empty with a law
    record: PathRecord
    train: np.ndarray  # bool (n,): what the fit saw
    predicted: np.ndarray  # stroke along the whole record (n,) [m]
    converged: bool
    warnings: tuple[str, ...]
    muscle: TensionLaw | None = None  # the law of the balance, where it is no curve
    knots: int = 6  # of the curve

    def problem(self) -> RecordProblem:
        """What was fitted, for a posterior: parameters at their fitted values, and the prediction of the stroke."""
        # NaN frees what is zero by default, such as creep
        known = self.known | dict.fromkeys(self.parameters, float("nan"))
        free, fixed = _parameters(self.record, self.train, self.model, self.muscle, known, self.knots)
        values = {n: e.value for n, e in self.parameters.items()}
        values |= {f"rise_{i}": float(v) for i, v in enumerate(np.diff(self.curve, prepend=0.0))}
        of = _predictor(self.record, self.train, self.model, self.muscle, fixed, tuple(free.items()), self.knots)
        return RecordProblem(
            parameters=free,
            start=np.array([f.scaled(values[n]) for n, f in free.items()]),
            model=HostModel(*of),
            measured=self.record.stroke,
            group=np.zeros(len(self.record.stroke), int),
            used=self.train,
            unit="m",
        )

    def posterior(self, *, noise: float | None = None, draws: int = 1000, seed: int = 0) -> RecordPosterior:
        """Draw from the posterior of a friction that was fitted to a loop, and of its curve or load.

        Args:
            noise: standard deviation of the sensor of the stroke [m]; found from the data where left out.
            draws: count of the samples.
            seed: same seed, same samples.

        Raises:
            ConvergenceError: the fit did not converge.
            MissingLibraryError: NumPyro is not installed; it comes with the extra ``posterior``.
        """
        check_converged(self.converged, f"The fit of {self.model} to the loop")
        return posterior_of_records(self.problem(), noise=noise, draws=draws, seed=seed)

    def with_discrepancy(self, *, noise: float | None = None) -> RecordPrediction:
        """Predict the stroke by friction, creep and a discrepancy that is smooth along the loop, given the seen samples.

        Args:
            noise: standard deviation of the sensor of the stroke [m]; found from the data where left out.

        Raises:
            ConvergenceError: the fit did not converge.
        """
        check_converged(self.converged, f"The fit of {self.model} to the loop", "to predict with")
        return predict_records(self.problem(), noise=noise)

    @property
    def error(self) -> np.ndarray:
        """Error of every sample (n,) [m]."""
        residuals: np.ndarray = self.predicted - self.record.stroke
        return residuals

    @property
    def aicc(self) -> float:
        """Akaike's criterion of the training samples with the correction for small samples."""
        return akaike(self.error[self.train], len(self.parameters) + len(self.curve) + 1)

    def width(self, pressure: Scalar) -> tuple[np.ndarray, np.ndarray]:
        """Width of the loop at gauge pressures [Pa], predicted and measured [m]; negative where the branches swap."""
        return self.record.with_stroke(self.predicted).width(pressure), self.record.width(pressure)

    @property
    def creep(self) -> float:
        """Stiffness of all Maxwell elements together [N/m]; zero without creep."""
        return self.parameters["creep"].value if "creep" in self.parameters else self.known.get("creep", 0.0)

    def friction(self) -> Hysteresis:
        """The fitted friction."""
        return MODELS[self.model][0](self.known | {n: e.value for n, e in self.parameters.items()})


def fit_loop(
    record: PathRecord,
    *,
    model: str = "bouc_wen",
    law: TensionLaw | None = None,
    train: np.ndarray | None = None,
    known: Mapping[str, float] | None = None,
    knots: int = 6,
) -> LoopFit:
    """Fit a friction to a loop of pressure and stroke.

    Args:
        record: the loop; it turns at least once.
        model: one of `MODELS`; Maxwell-slip may end on another minimum than the lowest, see `SHAKEN`.
        law: tension law of the muscle at its own length; by default, a monotone curve is fitted in its place.
        train: which samples the fit sees, bool (n,); all by default. The pressure is read along the whole path.
        known: parameters that are not fitted, by name [SI]; ``spring``, ``pressure_zero`` and ``creep`` are zero by default.
            ``creep=float("nan")``, for example, frees it.
        knots: knots of the monotone curve.

    Raises:
        InputError: names the field and what is allowed; for a parameter on which no seen sample depends.
        ConvergenceError: the fit ended where it began.
    """
    if model not in MODELS:
        raise InputError("model", model, f"must be {choice(MODELS)}")
    training = record.chosen(train)
    free, fixed = _parameters(record, training, model, law, dict(known or {}), knots)
    if training.sum() < len(free) + 3:
        raise InputError(
            "train",
            None,
            f"must have {len(free) + 3} samples or more for {len(free)} parameters, got {int(training.sum())}",
        )
    predict, slopes = _predictor(record, training, model, law, fixed, tuple(free.items()), knots)
    scale = max(float(np.ptp(record.stroke[training])), 1e-9)

    def error(x: np.ndarray) -> np.ndarray:
        return np.asarray((predict(x) - record.stroke)[training])

    estimation = Estimation(
        free,
        lambda x: np.nan_to_num(error(x) / scale, nan=1e3),
        lambda x: np.nan_to_num(slopes(x)[training] / scale),
        options={"max_nfev": 150, "ftol": 1e-9, "xtol": 1e-9, "gtol": 1e-9},
    )
    # Dahl's contact has no kinks: where many contacts are to be found, it first says where the curve and the friction lie.
    shared = {n: v for n, v in (known or {}).items() if n not in TRAVEL}
    kinked = model == "maxwell_slip"
    rough = fit_loop(record, model="dahl", law=law, train=training, known=shared, knots=knots) if kinked else None
    best = estimation.search(_starts(free, rough))
    draw = np.random.default_rng(SEED)
    for _ in range(SHAKEN):
        shaken = estimation.descend(best.x + SHAKE * draw.standard_normal(len(best.x)))
        best = min(best, shaken, key=lambda descent: descent.cost)
    left = error(best.x)
    # Errors follow one another only where no sample is left out between them.
    series = np.split(left, np.flatnonzero(np.diff(np.flatnonzero(training)) > 1) + 1)
    known_of = conclude(free, best, slopes(best.x)[training], left, subject=f"the loop with {model}", series=series)
    estimates = dict(known_of.parameters)
    curve = np.cumsum([estimates.pop(n).value for n in free if n.startswith("rise_")]) if law is None else np.zeros(0)
    lost = () if best.converged else (f"did not converge: {best.message}",)
    bound = (f"{n} lies on its bound" for n in at_bounds(free, best.x))
    missed = misfit("the stroke", record.stroke[training], left)
    return LoopFit(
        model,
        law is not None,
        estimates,
        fixed,
        curve,
        record,
        training,
        predict(best.x),
        best.converged,
        (*lost, *known_of.warnings, *bound, *missed),
        law,
        knots,
    )


def fit_loops(
    record: PathRecord,
    *,
    models: Iterable[str] = SMOOTH,
    creeps: Iterable[float] = (0.0,),
    known: Mapping[str, float] | None = None,
    **options: JsonValue,
) -> list[LoopFit]:
    """Fit several frictions, best first by `LoopFit.aicc`: the choice sees no sample that the fit did not see.

    Args:
        record: the loop.
        models: names of the frictions.
        creeps: stiffness of the creep to fit each with [N/m]; NaN for one that is fitted.
        known: as for `fit_loop`.
        **options: as for `fit_loop`.
    """
    both = [(m, {"creep": creep} | dict(known or {})) for m, creep in itertools.product(models, creeps)]
    fits = [fit_loop(record, model=m, known=k, **options) for m, k in both]
    return sorted(fits, key=lambda f: (not f.converged, f.aicc))


def _parameters(
    record: PathRecord, seen: np.ndarray, model: str, law: TensionLaw | None, known: dict[str, float], knots: int
) -> tuple[dict[str, Parameter], dict[str, float]]:
    every = dict(MODELS[model][1])
    settled = {"creep": 0.0} | ({"spring": 0.0, "pressure_zero": 0.0} if law is not None else {})
    stiff = AREA * float(np.ptp(record.pressure)) / max(float(np.ptp(record.stroke[seen])), 1e-9)
    every["creep"] = Parameter(0.1 * stiff, 1e-6 * stiff, 10.0 * stiff, "N/m", search="log")
    if law is not None:
        low, high = (float(x) for x in law.length_range())
        load = float(law.tension(0.5 * (low + high), float(record.pressure.max()) * 0.5))
        every["load"] = _value(max(load, 10.0), 0.0, 1e4, "N")
        every["start_length"] = _value(high, 0.8 * high, 1.2 * high, "m")
        every["spring"] = _value(0.0, -1e5, 1e5, "N/m")
        every["pressure_zero"] = _value(0.0, -1e5, 1e5, "Pa")
    elif knots < 3:
        raise InputError("knots", knots, "must be 3 or more")
    else:
        step = float(np.ptp(record.pressure)) / (knots - 1)
        every["rise_0"] = _value(float(record.pressure.min()), -1e6, 1e6, "Pa")
        rise = Parameter(step, 1e-3 * step, 100.0 * step, "Pa", search="log")
        every |= {f"rise_{i}": rise for i in range(1, knots)}
    for name in known:
        if name not in every:
            raise InputError(f"known.{name}", None, f"{model} has", known=every)
    fixed = settled | known
    fixed = {n: v for n, v in fixed.items() if np.isfinite(v)}
    return {n: f for n, f in every.items() if n not in fixed}, fixed


def _predictor(
    record: PathRecord,
    seen: np.ndarray,
    model: str,
    law: TensionLaw | None,
    fixed: dict[str, float],
    free: tuple[tuple[str, Parameter], ...],
    knots: int,
) -> Prediction:
    """Stroke of every sample, and its derivatives, of the scaled parameters: by all pressures, but by no hidden stroke."""
    from ..engine.prediction import prediction

    make = MODELS[model][0]
    shown, at_shown = record.stroke[seen], record.pressure[seen]
    reach = float(np.ptp(shown))
    place = float(shown.min()) + reach * np.linspace(0.0, 1.0, knots)
    begin = float(shown[np.argmin(np.abs(at_shown - record.pressure[0]))])
    # Strokes are searched as far as the shown ones say, and further where only others have the ends of the pressure.
    reach *= min(float(np.ptp(record.pressure)) / max(float(np.ptp(at_shown)), 1e-9), 10.0) ** 2
    twice, durations = np.tile(record.pressure, 2), np.tile(record.durations, 2)
    creeps = fixed.get("creep") != 0.0

    def stroke(x: Array, pressure: Array, duration: Array) -> Array:
        p = fixed | {n: f.value(x[i], jnp) for i, (n, f) in enumerate(free)}
        friction = make(p)
        chain = MaxwellChain.geometric(stiffness=p["creep"], shortest=SHORTEST, longest=LONGEST, elements=ELEMENTS)
        origin = p["start_length"] if law is not None else 0.0
        rises = None if law is not None else jnp.cumsum(jnp.stack([p[f"rise_{i}"] for i in range(knots)]))

        def balance(length: Scalar, at: Scalar) -> Any:
            if law is not None:
                return law.braid_tension(length, at - p["pressure_zero"]) - p["load"] - p["spring"] * (origin - length)
            return AREA * (at - _curve(-length, place, rises))

        start = origin - begin

        def resist(states: Tree, dx: Scalar, was: Scalar, at: Scalar, dt: Scalar) -> tuple[Tree, Scalar]:
            moved = friction.advance(states[0], dx, start_pressure=was, end_pressure=at, duration=0.0).state
            force = friction.force(moved, pressure=at)
            if not creeps:
                return (moved, states[1]), force
            springs = chain.advance(states[1], dx, duration=dt).state
            return (moved, springs), force + chain.force(springs)

        def step(carry: tuple[Tree, Tree, Tree], now: tuple[Tree, Tree]) -> tuple[Tree, Tree]:
            (before, states, was), (at, dt) = carry, now

            def excess(length: Scalar, states: Tree, before: Scalar) -> Any:
                return balance(length, at) + resist(states, length - before, was, at, dt)[1]

            length = _root(excess, states, before, start - 2.0 * reach, start + reach)
            return (length, resist(states, length - before, was, at, dt)[0], at), length

        states = friction.initial() + 0.0 * x[0], chain.initial() + 0.0 * x[0]
        carry = jnp.asarray(start) + 0.0 * x[0], states, pressure[0]
        _, length = jax.lax.scan(step, carry, (pressure, duration))
        strokes: Array = (origin - length)[-len(record.pressure) :]
        return strokes

    return prediction(stroke, len(free), twice, durations)


def _root(excess: Any, state: Tree, before: Scalar, low: Scalar, high: Scalar) -> Any:
    """The length where a rising force passes zero; a Newton step after the halvings carries the derivative."""
    held = jax.lax.stop_gradient((state, before, low + 0.0 * before, high + 0.0 * before))

    def halve(_: int, ends: tuple[Tree, Tree]) -> tuple[Tree, Tree]:
        middle = 0.5 * (ends[0] + ends[1])
        above = jax.lax.stop_gradient(excess(middle, held[0], held[1])) > 0.0
        return jnp.where(above, ends[0], middle), jnp.where(above, middle, ends[1])

    ends = jax.lax.fori_loop(0, HALVINGS, halve, (held[2], held[3]))
    middle = jax.lax.stop_gradient(0.5 * (ends[0] + ends[1]))
    _, slope = jax.jvp(lambda x: excess(x, held[0], held[1]), (middle,), (jnp.ones_like(middle),))
    slope = jax.lax.stop_gradient(slope)
    inside = (jnp.abs(slope) > 0.0) & (middle > held[2] + 1e-9) & (middle < held[3] - 1e-9)
    return middle - jnp.where(inside, excess(middle, state, before) / jnp.where(inside, slope, 1.0), 0.0)


def _curve(at: Scalar, place: np.ndarray, rises: Any) -> Any:
    """Monotone cubic through the knots (Fritsch and Butland's harmonic slopes), straight beyond them."""
    step = place[1] - place[0]
    chord = (rises[1:] - rises[:-1]) / step
    inner = 2.0 * chord[1:] * chord[:-1] / (chord[1:] + chord[:-1])
    slope = jnp.concatenate([chord[:1], inner, chord[-1:]])
    u = (at - place[:-1]) / step
    t = jnp.clip(u, 0.0, 1.0)
    # Every interval contributes its rise up to the point; intervals passed contribute all of it.
    rise = (
        step * ((t**3 - 2.0 * t**2 + t) * slope[:-1] + (t**3 - t**2) * slope[1:])
        + chord * step * (3.0 - 2.0 * t) * t**2
    )
    beyond = chord[0] * jnp.minimum(at - place[0], 0.0) + chord[-1] * jnp.maximum(at - place[-1], 0.0)
    return rises[0] + jnp.sum(rise) + beyond


def _starts(free: Mapping[str, Parameter], rough: LoopFit | None) -> list[np.ndarray]:
    """Starting points: as declared, with less friction, with stiffer contacts; or around a rough fit, travels spread."""
    base = {n: f.scaled(f.start) for n, f in free.items()}
    if rough is None:
        less = {n: v * (0.2 if n in ("constant", "per_pressure") else 1.0) for n, v in base.items()}
        stiffer = {n: v + (2.3 if n == "stiffness" else 0.0) for n, v in base.items()}
        return [np.array(list(start.values())) for start in (base, less, stiffer)]
    known = {n: e.value for n, e in rough.parameters.items()}
    known |= {f"rise_{i}": float(v) for i, v in enumerate(np.diff(rough.curve, prepend=0.0))}
    base |= {n: free[n].scaled(max(v, free[n].low)) for n, v in known.items() if n in free}
    starts = []
    for share, spread in itertools.product((0.05, 0.2), (5.0, 20.0, 80.0)):
        travel = share * max(float(rough.friction().largest_force(0.0)) / known["stiffness"], 1e-5)
        tried = {"shortest": travel, "spread": spread}
        starts.append(np.array([f.scaled(tried[n]) if n in tried else base[n] for n, f in free.items()]))
    return starts
