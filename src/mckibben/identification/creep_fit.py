"""Creep of a muscle from its stroke after a step of pressure, and how well the first part predicts the rest.

Under a constant force F the elements of a `KelvinVoigtChain` follow it in time, so that from any state at t = 0

    stroke(t) = s0 + g (P'(t) - P'(0)) + sum a_i (1 - exp(-t/tau_i)),      a_i = J_i F >= 0 after a rise, <= 0 after a fall

with time constants of fixed, logarithmic spacing. Only the s0, a_i are fitted, which is a linear problem: what the
elements took up before t = 0 is not in a_i. With `law` "logarithmic" all a_i are one, which is a creep of equal steps
per decade of time and the only one of the two that says something about times beyond the record. The pressure of a
held step still drifts; its share is taken off with a slope g of the quasi-static loop, which is not fitted.
Range: one held step; elements slower than the record are not in the data.
Source: W. N. Findley, J. S. Lai and K. Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials, North-Holland
1976, chapter 5 (generalised Kelvin model).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._jax import Scalar
from ..errors import InputError, choice
from ..estimation import Estimate, Parameter, PartialFit, akaike, conclude, descend_linear
from ..muscles.elements import KelvinVoigtChain

LAWS = ("free", "logarithmic")
FEWEST = 8


@dataclass(frozen=True)
class CreepFit(PartialFit):
    """Result of a fit of creep after a step; errors in metres of stroke, prediction less measurement."""

    law: str
    amplitudes: tuple[Estimate, ...]  # a_i [m], signed
    start: Estimate  # s0 [m]
    time_constants: np.ndarray  # [s]
    pressure_slope: float  # g [m/Pa]
    time: np.ndarray  # since the first sample (n,) [s]
    stroke: np.ndarray  # measured (n,) [m]
    train: np.ndarray  # bool (n,): what the fit saw
    predicted: np.ndarray  # (n,) [m]
    warnings: tuple[str, ...]

    @property
    def error(self) -> np.ndarray:
        """Error of every sample (n,) [m]."""
        residuals: np.ndarray = self.predicted - self.stroke
        return residuals

    @property
    def aicc(self) -> float:
        """Akaike's criterion of the training samples with the correction for small samples."""
        return akaike(self.error[self.train], (1 if self.law == "logarithmic" else len(self.amplitudes)) + 2)

    def predict(self, time: Scalar, pressure_change: Scalar = 0.0) -> np.ndarray:
        """Stroke at times since the first sample [s], with the pressure so much above that of the first sample [Pa]."""
        steps = np.array([a.value for a in self.amplitudes])
        creep = _growth(np.asarray(time, float), self.time_constants) @ steps
        predicted: np.ndarray = self.start.value + self.pressure_slope * np.asarray(pressure_change, float) + creep
        return predicted

    def chain(self, force: float) -> KelvinVoigtChain:
        """The creep element whose extension under a constant force [N] is this creep; elements without a step left out.

        A muscle that creeps shorter follows a force that pulls it shorter: its sign goes with the step's.
        """
        if not (np.isfinite(force) and force > 0.0):
            raise InputError("force", force, "must be a force above 0 N")
        steps = np.abs([a.value for a in self.amplitudes])
        used = steps / force >= 1e-12  # the smallest compliance that a chain takes
        if not used.any():
            raise InputError("creep", None, "must be in a record that creeps")
        return KelvinVoigtChain(compliance=steps[used] / force, time_constant=self.time_constants[used])


def fit_creep(
    time: Scalar,
    stroke: Scalar,
    *,
    train: np.ndarray | None = None,
    law: str = "free",
    shortest: float | None = None,
    longest: float | None = None,
    per_decade: int = 2,
    pressure: Scalar | None = None,
    pressure_slope: float = 0.0,
    name: str = "record",
) -> CreepFit:
    """Fit a chain of creep elements to the stroke after a step.

    Args:
        time: time of the samples (n,), rising [s]; the first is t = 0.
        stroke: (n,) [m].
        train: which samples the fit sees, bool (n,); all by default. The first half is ``creep_half(time)``.
        law: ``free``, an amplitude for each element, or ``logarithmic``, one amplitude for all.
        shortest: shortest time constant [s]; three sampling intervals by default.
        longest: longest time constant [s]; the span of the seen samples by default.
        per_decade: elements per decade of time.
        pressure: gauge pressure of the samples (n,) [Pa]; taken as held by default.
        pressure_slope: stroke per pressure of the branch that the step ended on [m/Pa].
        name: name of the record, for error messages.

    Returns:
        Intervals of 95 %, widened for residuals that follow one another. An amplitude on its bound of zero has none of
        its own: its interval is what the others leave it.

    Raises:
        InputError: names the field and what is allowed.
    """
    t, s, p, training = _checked(time, stroke, pressure, train, name)
    if law not in LAWS:
        raise InputError("law", law, f"must be {choice(LAWS)}", where=name)
    if not np.isfinite(pressure_slope):
        raise InputError("pressure_slope", pressure_slope, "must be a finite slope [m/Pa]", where=name)
    tau = _spread(t, training, shortest, longest, per_decade, name)
    drift = pressure_slope * (p - p[0])
    columns = _growth(t, tau)
    if law == "logarithmic":
        columns = columns.sum(axis=1, keepdims=True)
    wanted = s - drift
    some = wanted[training]
    tail = max(1, len(some) // 4)
    sign = 1.0 if some[-tail:].mean() >= some[:tail].mean() else -1.0
    matrix = np.column_stack([np.ones(len(t)), sign * columns])
    if training.sum() < matrix.shape[1] + 2:
        allowed = f"is {int(training.sum())} samples: {matrix.shape[1]} parameters need {matrix.shape[1] + 2} or more"
        raise InputError("train", None, allowed, where=name)
    step = Parameter(0.0, 0.0, np.inf, "m", size=sign)
    parameters = {"start": step._replace(low=-np.inf, size=1.0)} | {f"a_{i}": step for i in range(columns.shape[1])}
    best = descend_linear(matrix[training], some, low=np.array([p.low for p in parameters.values()]), tol=1e-12)
    fitted = matrix @ best.x
    residual = (fitted - wanted)[training]
    found = conclude(parameters, best, matrix[training], residual, series=[residual])
    start, *steps = found.parameters.values()
    amplitudes = tuple(steps * len(tau)) if law == "logarithmic" else tuple(steps)
    zero = ["no creep of this sign is in the data"] if not np.any(best.x[1:] > 0.0) else []
    return CreepFit(
        law, amplitudes, start, tau, float(pressure_slope), t, s, training, fitted + drift, (*found.warnings, *zero)
    )


def creep_half(time: Scalar) -> np.ndarray:
    """The samples of the first half of the time, bool (n,)."""
    t = np.asarray(time, float)
    half: np.ndarray = t <= 0.5 * (t[0] + t[-1])
    return half


def _growth(time: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Extension of elements of unit compliance under a unit force (..., elements)."""
    chain = KelvinVoigtChain(compliance=np.ones(len(tau)), time_constant=tau)
    return np.asarray(chain.advance(chain.initial(), np.ones(time.shape), duration=time).state)


def _spread(
    t: np.ndarray, seen: np.ndarray, shortest: float | None, longest: float | None, per_decade: int, name: str
) -> np.ndarray:
    low = 3.0 * float(np.median(np.diff(t))) if shortest is None else float(shortest)
    high = float(np.ptp(t[seen])) if longest is None else float(longest)
    if not (np.isfinite(low) and low >= 1e-4):
        raise InputError("shortest", low, "must be 1e-4 s or more", where=name)
    if not (np.isfinite(high) and low < high <= 1e6):
        raise InputError("longest", high, f"must be above the shortest, {low:g} s, up to 1e6 s", where=name)
    if per_decade < 1:
        raise InputError("per_decade", per_decade, "must be 1 or more", where=name)
    elements = 1 + max(1, round(per_decade * float(np.log10(high / low))))
    return np.asarray(
        KelvinVoigtChain.geometric(compliance=1.0, shortest=low, longest=high, elements=elements).time_constant
    )


def _checked(
    time: Scalar, stroke: Scalar, pressure: Scalar | None, train: np.ndarray | None, name: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    arrays: dict[str, np.ndarray] = {}
    for field, value in {"time": time, "stroke": stroke, "pressure": pressure}.items():
        if field == "pressure" and value is None:
            value = np.zeros_like(arrays["time"])
        try:
            row = np.asarray(value, float)
        except (TypeError, ValueError):
            raise InputError(field, None, "must be one number per sample", where=name) from None
        if row.ndim != 1 or not np.isfinite(row).all():
            raise InputError(field, None, "must be one finite number per sample", where=name)
        arrays[field] = row
    t, s, p = arrays["time"], arrays["stroke"], arrays["pressure"]
    if not len(t) == len(s) == len(p):
        raise InputError(
            "samples",
            None,
            f"must be as many of time, stroke and pressure, got {len(t)}, {len(s)} and {len(p)}",
            where=name,
        )
    if len(t) < FEWEST:
        raise InputError("samples", len(t), f"must be {FEWEST} or more", where=name)
    if not (np.diff(t) > 0.0).all():
        raise InputError("time", None, "must rise from sample to sample", where=name)
    training = np.ones(len(t), bool) if train is None else np.asarray(train)
    if training.shape != t.shape or training.dtype != bool:
        raise InputError("train", None, f"must be bool ({len(t)},), got {training.dtype} {training.shape}", where=name)
    return t - t[0], s, p, training
