"""Samples of the parameters of a model from measured data, by the No-U-Turn sampler of NumPyro.

The measurement y (n,) of a prediction m(x) is taken as

    y = m(x) + d + Z o + e,     e ~ N(0, k^2 S),     d ~ N(0, s^2 C),     o ~ N(0, t^2 I)

with the covariance S of the sensors, known up to the factor k, a discrepancy d: a smooth Gaussian process of unit
variance C and amplitude s, which stands for what the model has no parameter for, and an error o of each run, which all its
values share (Z is 1 where a value is of a run), with the standard deviation t. All are integrated out in closed form;
with S = R R' and the eigenvectors U and eigenvalues c of R^-1 C R^-T, z = U' R^-1 (y - m), and v = k^2 + s^2 c, the
likelihood of values without runs is

    log p = -1/2 sum( z^2/v + log v )

so that a step of the sampler needs one prediction with its derivatives and no factorisation. With runs, W = U' R^-1 Z and
A = v^-1/2 W, the covariance of z is v + t^2 W W', of low rank beside its diagonal, and by Woodbury's identity

    log p = -1/2 sum( z^2/v + log v ) + t^2/2 b' M^-1 b - 1/2 log det M,     M = I + t^2 A' A,     b = A' v^-1/2 z

with one factorisation of a matrix of the size of the number of runs. Points without tension say
that the model may not pull there: each gives the probability that the prediction is not positive.
Priors: x uniform between its bounds, within `REACH` standard deviations of the fit (`around`); log k normal; s, and t, with
much of its mass near zero, so that a discrepancy costs little where the law is right, and with the tail of a Cauchy
distribution, so that one that is much larger than expected need not pass for noise. Bounds that are far too wide outweigh
the data: a muscle that never pulls, its tension all discrepancy, has few parameters that matter and so the larger volume.
The chains run in the normal scores of the uniform parameters, standardised by the curvature at the mode, the more probable
of those that searches from the fit and from within the bounds find. Until they agree,
they go on from where they are, standardised anew by the covariance of what they have drawn, for `ROUNDS` in all.
Sources: M. C. Kennedy and A. O'Hagan, Bayesian calibration of computer models, J. R. Stat. Soc. B 63(3), 2001;
M. D. Hoffman and A. Gelman, The No-U-Turn sampler, J. Mach. Learn. Res. 15, 2014.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, Tree, jax, jnp
from ..extras import library

Model = Callable[[Any, Tree], Any]


class HostModel(NamedTuple):
    """A prediction (n,) and its derivatives (n, p) by the parameters (p,), of arrays of NumPy."""

    predict: Callable[[np.ndarray], np.ndarray]
    slopes: Callable[[np.ndarray], np.ndarray]


CHAINS, WARM_UP, DRAWS = 4, 500, 2000
LENGTHS = (0.15, 0.3, 0.6)  # correlation lengths of the discrepancy that are tried, of the range of each coordinate
KNOWN_NOISE, UNKNOWN_NOISE = 0.1, 1.0  # standard deviation of log k where the sensors are known, and where not
SHAPE = 0.3  # power of s and of t below its scale, of the prior of its logarithm; above it is -1
FAR = 1e9  # stands for a prediction that is not finite
SEARCH = 300  # iterations of the search for the mode
TREE_DEPTH = 8
ACCEPTED = 0.97  # share of the proposals; at 0.9, of longer steps, single chains stay in a narrow bend of the posterior
ROUNDS = 4  # of all chains, each of a warm-up and samples
FEWEST_EACH = 150  # samples of a chain in a round: fewer seldom mix, and another round costs another warm-up
RUN_COLUMNS = 6  # the count of runs is filled up to a multiple of it
REACH = 8.0  # of the uniform prior to either side of the fit, in standard deviations of the linearised model
MIXED, FEW = 1.05, 200  # largest R-hat, and fewest independent samples, of chains that are said to have mixed
LOST = 0.01  # largest share of the samples at which the sampler may lose its path
EDGES = (1e-6, 0.1)  # shares of the room between the bounds within which no search for the mode begins, of each search


class ErrorModes(NamedTuple):
    """Sensor noise and discrepancy of n values as n independent errors.

    Attributes:
        values: eigenvalues c (n,): variance of the discrepancy of unit amplitude over that of the sensors.
        directions: U' R^-1 (n, n), which makes the independent errors of a residual.
    """

    values: np.ndarray
    directions: np.ndarray

    @classmethod
    def of(cls, covariance: np.ndarray, correlation: np.ndarray) -> ErrorModes:
        """Of the covariance S of the sensors and the correlation C of the discrepancy, (n, n) each."""
        root = np.linalg.cholesky(covariance)
        half = np.linalg.solve(root, correlation)
        values, vectors = np.linalg.eigh(np.linalg.solve(root, half.T))
        return cls(np.maximum(values, 0.0), np.linalg.solve(root.T, vectors).T)


@dataclass(frozen=True)
class Evidence:
    """Measured values, their errors, and the prediction of a model.

    Attributes:
        model: prediction of all points (n + m,), those without tension last, by JAX from the parameters (p,) and `inputs`;
            `host_model` where it is no function of JAX. It is compiled once for all data of one size.
        inputs: tree of arrays.
        measured: values (n,).
        modes: errors of these values.
        slack_variance: variance of the sensor at each point without tension (m,).
        low: lower bounds of the parameters (p,).
        high: upper bounds (p,).
        start: parameters at which the search for the mode begins (p,).
        noise_known: whether the covariance is that of a known sensor, else its size is found from the data.
        amplitude: scale of the prior of the discrepancy's amplitude, in the unit of the values; no discrepancy where 0.
        host: prediction and derivatives that `host_model` calls.
        runs: 1 where a value belongs to a run, else 0 (n, r); no column where runs have no error of their own.
        run_scale: scale of the prior of the error of a run, in the unit of the values.
    """

    model: Model
    inputs: Tree
    measured: np.ndarray
    modes: ErrorModes
    slack_variance: np.ndarray
    low: np.ndarray
    high: np.ndarray
    start: np.ndarray
    noise_known: bool
    amplitude: float
    host: HostModel | None = None
    runs: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    run_scale: float = 1.0

    @property
    def noise_spread(self) -> float:
        """Standard deviation of the prior of log k."""
        return KNOWN_NOISE if self.noise_known else UNKNOWN_NOISE


class Draws(NamedTuple):
    """Samples of a posterior: parameters (d, p), factor k of the noise (d,), amplitude s (d,), and how well they mixed.

    `run` is the standard deviation t of the error of a run (d,), None without runs.
    `worst` is the place of the parameter on which the chains agree least, p for the noise.
    """

    parameters: np.ndarray
    noise: np.ndarray
    amplitude: np.ndarray
    r_hat: float
    effective: float
    divergences: int
    worst: int = 0
    run: np.ndarray | None = None


def around(
    start: np.ndarray, slopes: np.ndarray, covariance: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the uniform prior within `REACH` standard deviations of a fit.

    Args:
        start: fitted parameters (p,).
        slopes: derivatives of the prediction there (n, p).
        covariance: of sensors and discrepancy together (n, n).
        low: lower bounds (p,).
        high: upper bounds (p,).
    """
    rows = np.linalg.solve(np.linalg.cholesky(covariance), slopes)
    size = np.sqrt((rows**2).sum(axis=0))
    seen = size > 0.0
    strength, directions = np.linalg.eigh((rows[:, seen] / size[seen]).T @ (rows[:, seen] / size[seen]))
    room = np.full(len(start), np.inf)
    room[seen] = REACH * np.sqrt((directions**2 / np.maximum(strength, 1e-12)).sum(axis=1)) / size[seen]
    return np.maximum(low, start - room), np.minimum(high, start + room)


def matern(first: np.ndarray, second: np.ndarray, length: float) -> np.ndarray:
    """Correlation of a Matern process of order 5/2 between points (n, c) and (m, c) at one length, shape (n, m)."""
    distance = np.sqrt(((first[:, None, :] - second[None, :, :]) ** 2).sum(axis=-1)) * (np.sqrt(5.0) / length)
    correlation: np.ndarray = (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)
    return correlation


def marginal(
    values: np.ndarray,
    coefficients: Any,
    noise: Any,
    amplitude: Any,
    runs: Any = None,
    deviation: Any = 0.0,
    xp: Any = np,
) -> Any:
    """Logarithm of the likelihood of coefficients z, up to a constant.

    Args:
        values: eigenvalues c (n,).
        coefficients: z (n,).
        noise: factor k of the noise.
        amplitude: s of the discrepancy.
        runs: W, what each run adds to the coefficients (n, r); none where left out.
        deviation: standard deviation t of the error of a run.
        xp: library of the arrays, NumPy or that of JAX.
    """
    variance = noise**2 + amplitude**2 * values
    independent = -0.5 * (coefficients**2 / variance + xp.log(variance)).sum()
    if runs is None:
        return independent
    scale = xp.sqrt(variance)
    columns = runs / scale[:, None]
    root = xp.linalg.cholesky(xp.eye(runs.shape[1]) + deviation**2 * columns.T @ columns)
    right = columns.T @ (coefficients / scale)
    shared = np.linalg.solve(root, right) if xp is np else jax.scipy.linalg.solve_triangular(root, right, lower=True)
    return independent + 0.5 * deviation**2 * (shared**2).sum() - xp.log(xp.diagonal(root)).sum()


class Precision(NamedTuple):
    """Inverse covariance of coefficients z for samples of k, s and t, applied without a factorisation of size n.

    Attributes:
        inverse: 1/v of each sample (d, n).
        columns: W (n, r), or none without runs.
        inner: t^2 M^-1 of each sample (d, r, r), or none without runs.
    """

    inverse: np.ndarray
    columns: np.ndarray | None
    inner: np.ndarray | None

    @classmethod
    def of(
        cls,
        values: np.ndarray,
        noise: np.ndarray,
        amplitude: np.ndarray,
        runs: np.ndarray | None = None,
        deviation: np.ndarray | None = None,
    ) -> Precision:
        """Of eigenvalues c (n,), samples of k, s and t (d,), and what runs add to the coefficients (n, r)."""
        inverse = 1.0 / (noise[:, None] ** 2 + amplitude[:, None] ** 2 * values)
        if runs is None or deviation is None:
            return cls(inverse, None, None)
        size = deviation[:, None, None] ** 2
        matrix = np.eye(runs.shape[1]) + size * np.einsum("nr,dn,ns->drs", runs, inverse, runs, optimize=True)
        return cls(inverse, runs, size * np.linalg.inv(matrix))

    def times(self, coefficients: np.ndarray) -> np.ndarray:
        """Product with the coefficients of each sample (d, n)."""
        scaled = coefficients * self.inverse
        if self.columns is None or self.inner is None:
            return np.asarray(scaled)
        shared = np.einsum("drs,ds->dr", self.inner, scaled @ self.columns)
        return np.asarray(scaled - self.inverse * (shared @ self.columns.T))

    def squares(self, rows: np.ndarray) -> np.ndarray:
        """Squared length of rows (q, n) in each sample's metric (d, q)."""
        whole = self.inverse @ (rows**2).T
        if self.columns is None or self.inner is None:
            return np.asarray(whole)
        shared = np.einsum("qn,dn,nr->dqr", rows, self.inverse, self.columns, optimize=True)
        return np.asarray(whole - np.einsum("dqr,drs,dqs->dq", shared, self.inner, shared, optimize=True))


def discrepancy_given(
    precision: Precision, onto: np.ndarray, residuals: np.ndarray, amplitude: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of the discrepancy at places, given the data, of samples (d, q).

    Args:
        precision: of the coefficients.
        onto: correlation of the places with the modes (q, n).
        residuals: measurement less prediction of each sample, as modes (d, n).
        amplitude: of the discrepancy of each sample (d,).
    """
    size = amplitude[:, None] ** 2
    mean = size * precision.times(residuals) @ onto.T
    left = size - size**2 * precision.squares(onto)
    return mean, np.sqrt(np.maximum(left, 0.0))


class ErrorSizes(NamedTuple):
    """Errors under which some residuals are the most probable.

    Attributes:
        length: correlation length.
        noise: factor k of the noise.
        amplitude: s of the discrepancy.
        run: standard deviation t of the error of a run; 0 without runs.
    """

    length: float
    noise: float
    amplitude: float
    run: float = 0.0

    def covariance(
        self, sensors: np.ndarray, smooth: np.ndarray, amplitude: float, runs: np.ndarray | None = None
    ) -> np.ndarray:
        """Covariance (n, n) of sensors, discrepancy and runs, at least of their own and of a stated amplitude.

        Args:
            sensors: covariance of the sensors (n, n).
            smooth: correlation of the discrepancy (n, n).
            amplitude: least amplitude of the discrepancy.
            runs: 1 where a value belongs to a run, else 0 (n, r).
        """
        whole = np.asarray(max(self.noise, 1.0) ** 2 * sensors + max(self.amplitude, amplitude) ** 2 * smooth)
        return whole if runs is None else whole + self.run**2 * runs @ runs.T


def error_sizes(
    residual: np.ndarray,
    coordinates: np.ndarray,
    covariance: np.ndarray,
    top: float,
    *,
    noise_known: bool,
    tried: Sequence[float] = LENGTHS,
    runs: np.ndarray | None = None,
) -> ErrorSizes:
    """The errors under which the residuals of the least squares are the most probable.

    Args:
        residual: measurement less prediction (n,).
        coordinates: of the points (n, c), each scaled to its range.
        covariance: of the sensors (n, n).
        top: largest amplitude to try [unit of the residual].
        noise_known: whether the covariance is that of a known sensor.
        tried: correlation lengths, of the range of each coordinate.
        runs: 1 where a value belongs to a run, else 0 (n, r).
    """
    noises = np.geomspace(0.8, 1.25, 3) if noise_known else np.geomspace(0.3, 30.0, 9)
    size = np.sqrt(np.diag(covariance).mean())
    amplitudes = np.geomspace(0.1 * size, max(top, size), 9)
    deviations = [0.0] if runs is None else amplitudes
    scores: dict[ErrorSizes, float] = {}
    for length in tried:
        values, directions = ErrorModes.of(covariance, matern(coordinates, coordinates, length))
        z, columns = directions @ residual, None if runs is None else directions @ runs
        scores |= {
            ErrorSizes(length, k, s, t): float(marginal(values, z, k, s, columns, t))
            for k in noises for s in amplitudes for t in deviations
        }  # fmt: skip
    return max(scores, key=scores.__getitem__)


def sample(
    evidence: Evidence, *, draws: int = DRAWS, chains: int = CHAINS, warm_up: int = WARM_UP, seed: int = 0
) -> Draws:
    """Draw from the posterior of a model's parameters.

    Args:
        evidence: data, sensors and prediction.
        draws: count of the samples of all chains together; rounded up to a multiple of the chains.
        chains: chains that run beside each other.
        warm_up: samples of each chain that adapt the step and are left out.
        seed: same seed, same samples.

    Raises:
        MissingLibraryError: NumPyro is not installed; it comes with the extra ``posterior``.
    """
    library("numpyro.diagnostics", "Samples of a posterior need")
    each = -(-draws // chains)
    with _host.lock:
        kernel = _kernel(evidence.model, chains, warm_up, max(each, FEWEST_EACH))
        _host.current = evidence.host
        data = _data(evidence)
        return _draws(evidence, _rounds(kernel, data, _mode(evidence, data), chains=chains, seed=seed), each)


def mixing_warnings(r_hat: float, effective: float, divergences: int, count: int, worst: str = "") -> tuple[str, ...]:
    """What speaks against the use of samples, as text; empty if nothing does.

    Args:
        r_hat: largest ratio of the variances between and within the chains.
        effective: fewest independent samples of a parameter.
        divergences: count of the samples at which the sampler lost its path.
        count: count of the samples.
        worst: name of the parameter on which the chains agree least, if it is known.
    """
    warnings = []
    if not r_hat <= MIXED:  # nor where it is not a number
        place = f" about {worst}" if worst else ""
        warnings.append(
            f"the chains disagree{place} (R-hat {r_hat:.2f}) although they went on until the last round: "
            f"the data leave it open; fix {worst or 'a parameter'}, or measure more points"
        )
    elif not effective >= FEW:
        warnings.append(f"only {effective:.0f} samples are independent: draw more")
    if divergences > LOST * count:
        warnings.append(f"the sampler lost its path at {divergences} of {count} samples")
    return tuple(warnings)


class _Round(NamedTuple):
    """Unbounded samples of all chains (chains, each, p + 2; with runs p + 3), and whether the sampler lost its path."""

    places: np.ndarray
    lost: np.ndarray


class _Mixing(NamedTuple):
    r_hat: float
    effective: float
    divergences: int
    worst: int

    def enough(self, count: int) -> bool:
        """Whether nothing speaks against the use of a count of samples."""
        return not mixing_warnings(self.r_hat, self.effective, self.divergences, count)


def _rounds(
    kernel: Any, data: dict[str, Any], mode: tuple[np.ndarray, np.ndarray], *, chains: int, seed: int
) -> tuple[_Round, _Mixing]:
    """Samples of the last rounds that agree best, of as many as it takes."""
    centre, spread = mode
    first, *keys = jax.random.split(jax.random.key(seed), ROUNDS + 1)
    z = np.asarray(0.5 * jax.random.normal(first, (chains, len(centre))))
    rounds: list[_Round] = []
    for key in keys:
        chain, lost = kernel(jax.random.split(key, chains), z, data | {"centre": centre, "spread": spread})
        rounds.append(_Round(centre + np.asarray(chain) @ spread.T, np.asarray(lost)))
        tails = [_Round(*(np.concatenate(part, axis=1) for part in zip(*rounds[i:], strict=True)))
                 for i in range(len(rounds))]  # fmt: skip
        both = [(tail, _mixing(tail, len(data["low"]) + 1)) for tail in tails]
        best = min(both, key=lambda one: (not one[1].enough(one[0].lost.size), one[1].r_hat))
        if best[1].enough(best[0].lost.size):
            break
        flat = rounds[-1].places.reshape(-1, len(centre))
        covariance = np.cov(flat.T)
        scale = np.sqrt(np.maximum(np.diag(covariance), 1e-16))
        strength, directions = np.linalg.eigh(covariance / np.outer(scale, scale))
        # directions in which nothing moved have a small variance
        centre, spread = flat.mean(axis=0), scale[:, None] * directions * np.sqrt(np.maximum(strength, 1e-6))
        z = np.linalg.solve(spread, (rounds[-1].places[:, -1] - centre).T).T
    return best


def _mixing(one: _Round, counted: int) -> _Mixing:
    from numpyro import diagnostics

    # all but the sizes of discrepancy and runs, which data without these leave open over many orders
    columns = np.moveaxis(one.places, -1, 0)[:counted]
    ratios = np.array([float(diagnostics.split_gelman_rubin(column)) for column in columns])
    ratios = np.nan_to_num(ratios, nan=np.inf)  # of chains that never moved
    effective = min(float(diagnostics.effective_sample_size(column)) for column in columns)
    return _Mixing(float(ratios.max()), effective, int(one.lost.sum()), int(ratios.argmax()))


def _draws(evidence: Evidence, drawn: tuple[_Round, _Mixing], each: int) -> Draws:
    """As many samples of every chain, evenly from all."""
    from scipy.special import ndtr

    (places, lost), mixing = drawn
    count = len(evidence.start)
    some = np.linspace(0, places.shape[1] - 1, each).round().astype(int)
    flat = places[:, some].reshape(-1, places.shape[-1])
    share = len(flat) / lost.size
    return Draws(
        parameters=evidence.low + (evidence.high - evidence.low) * ndtr(flat[:, :count]),
        noise=np.exp(flat[:, count]),
        amplitude=np.exp(flat[:, count + 1]) if evidence.amplitude > 0.0 else np.zeros(len(flat)),
        r_hat=mixing.r_hat,
        effective=min(mixing.effective, float(len(flat))),
        divergences=round(share * mixing.divergences),
        worst=mixing.worst,
        run=np.exp(flat[:, count + 2]) if evidence.runs.size else None,
    )


class _Host:
    """What compiled chains call for a prediction that is no function of JAX."""

    lock = threading.RLock()
    current: HostModel | None = None


_host = _Host()


@functools.cache
def host_model(points: int, count: int) -> Model:
    """A prediction of a count of points by a count of parameters that JAX can differentiate, by `Evidence.host`."""
    shapes = jax.ShapeDtypeStruct((points,), float), jax.ShapeDtypeStruct((points, count), float)

    def both(x: Scalar) -> Any:
        return jax.pure_callback(_predicted, shapes, x)

    predict = jax.custom_vjp(lambda x: both(x)[0])
    predict.defvjp(both, lambda slopes, up: (up @ slopes,))
    return lambda x, inputs: predict(x)


def _predicted(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Prediction (n,) and derivatives (n, p) of the host for parameters (p,)."""
    host = _host.current
    assert host is not None
    return finite(host.predict(np.asarray(x)), host.slopes(np.asarray(x)), np)


def finite(values: Any, slopes: Any, xp: Any = jnp) -> tuple[Any, Any]:
    """A prediction (n,) and its derivatives (n, p) as finite numbers, by NumPy or, as by default, by JAX."""
    far = xp.nan_to_num(values, nan=FAR, posinf=FAR, neginf=-FAR)
    return far, xp.nan_to_num(slopes, nan=0.0, posinf=0.0, neginf=0.0)


def _data(evidence: Evidence) -> dict[str, Any]:
    directions = evidence.modes.directions
    runs = {}
    if evidence.runs.size:
        # columns of zeros change nothing, and one compiled function serves any number of runs up to theirs
        room = -evidence.runs.shape[1] % RUN_COLUMNS
        columns = np.pad(directions @ evidence.runs, ((0, 0), (0, room)))
        runs = {"runs": columns, "run_scale": np.asarray(evidence.run_scale)}
    return runs | {
        "inputs": evidence.inputs,
        "measured": evidence.measured,
        "values": evidence.modes.values,
        "directions": directions,
        "slack_variance": evidence.slack_variance,
        "low": evidence.low,
        "high": evidence.high,
        "amplitude": np.asarray(max(evidence.amplitude, 1e-30)),
        "spread_of_noise": np.asarray(evidence.noise_spread),
        "with_discrepancy": np.asarray(float(evidence.amplitude > 0.0)),
    }


def _potential(u: Any, data: Any, model: Model) -> Any:
    """Negative logarithm of the posterior of unbounded parameters (p + 2,): normal scores, log k, log s; of runs log t."""
    count, points = len(data["low"]), len(data["measured"])
    inner, log_noise, log_amplitude = u[:count], u[count], u[count + 1]
    x = data["low"] + (data["high"] - data["low"]) * jax.scipy.special.ndtr(inner)
    prior = -0.5 * (inner**2).sum()
    prior -= 0.5 * (log_noise / data["spread_of_noise"]) ** 2
    noise, amplitude = jnp.exp(log_noise), jnp.exp(log_amplitude)
    # Without a discrepancy its amplitude is a normal number that nothing depends on.
    heavy = log_prior_of_size(log_amplitude, amplitude, data["amplitude"])
    prior += jnp.where(data["with_discrepancy"] > 0.0, heavy, -0.5 * log_amplitude**2)
    amplitude = amplitude * data["with_discrepancy"]
    predicted = model(x, data["inputs"])
    z = data["directions"] @ (data["measured"] - predicted[:points])
    run: Any = 0.0
    runs = data.get("runs")  # present or not when this is traced
    if runs is not None:
        run = jnp.exp(u[count + 2])
        prior += log_prior_of_size(u[count + 2], run, data["run_scale"])
    likelihood = marginal(data["values"], z, noise, amplitude, runs, run, jnp)
    wide = jnp.sqrt(noise**2 * data["slack_variance"] + amplitude**2 + run**2)
    likelihood += jax.scipy.stats.norm.logcdf(-predicted[points:] / wide).sum()
    return -prior - likelihood


def log_prior_of_size(logarithm: Any, size: Any, scale: Any, xp: Any = jnp) -> Any:
    """Logarithm of the prior of the logarithm of s or t, by NumPy or, as by default, by JAX."""
    return SHAPE * logarithm - 0.5 * (1.0 + SHAPE) * xp.log1p((size / scale) ** 2)


def _mode(evidence: Evidence, data: Any) -> tuple[np.ndarray, np.ndarray]:
    """Mode of the posterior, and a root of the covariance there, in unbounded parameters (p + 2 or, with runs, p + 3,)."""
    from scipy import optimize, special

    value_and_slope = _compiled_potential(evidence.model)

    def objective(u: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = value_and_slope(u, data)
        return float(np.nan_to_num(value, nan=1e12)), np.nan_to_num(np.asarray(slope, float))

    room = evidence.high - evidence.low
    sizes = [np.log(0.2 * evidence.amplitude) if evidence.amplitude > 0.0 else 0.0]
    sizes += [np.log(evidence.run_scale)] if evidence.runs.size else []
    searches = []
    for edge in EDGES:  # a fit that ended at a bound begins in a corner, which may have a mode of its own
        share = np.clip((evidence.start - evidence.low) / room, edge, 1.0 - edge)
        begin = np.concatenate([special.ndtri(share), [0.0], sizes])
        search = optimize.minimize(objective, begin, jac=True, method="BFGS", options={"maxiter": SEARCH})
        lower = np.isfinite(search.fun) and search.fun <= objective(begin)[0]
        centre = search.x if lower else begin
        searches.append((objective(centre)[0], centre, np.diag(search.hess_inv)))
    _, centre, variance = min(searches, key=lambda one: one[0])
    curvature = np.empty((len(begin), len(begin)))
    for i in range(len(begin)):
        # a step that changes the potential by about one hundredth, from the search's own estimate of the covariance
        step = np.zeros(len(begin))
        step[i] = 0.1 * np.sqrt(np.clip(variance[i], 1e-16, 1.0))
        up, down = objective(centre + step)[1], objective(centre - step)[1]
        curvature[i] = (up - down) / (2.0 * step[i])
    scale = 1.0 / np.sqrt(np.clip(np.abs(np.diag(curvature)), 1e-2, 1e16))
    strength, directions = np.linalg.eigh(scale[:, None] * 0.5 * (curvature + curvature.T) * scale)
    return centre, scale[:, None] * directions / np.sqrt(np.clip(np.abs(strength), 1e-6, None))


@functools.lru_cache(maxsize=16)
def _compiled_potential(model: Model) -> Any:
    return jax.jit(jax.value_and_grad(lambda u, data: _potential(u, data, model)))


@functools.lru_cache(maxsize=16)
def _kernel(model: Model, chains: int, warm_up: int, each: int) -> Any:
    """All chains as one compiled function of their keys, first points and the data."""
    hmc = library("numpyro.infer.hmc", "Samples of a posterior need").hmc

    def density(data: Any) -> Any:
        return lambda z: _potential(data["centre"] + data["spread"] @ z, data, model)

    def chain(key: Any, z: Any, data: Any) -> Any:
        begin, advance = hmc(potential_fn_gen=density, algo="NUTS")
        state = begin(
            z, warm_up, step_size=0.5, dense_mass=True, target_accept_prob=ACCEPTED, max_tree_depth=TREE_DEPTH,
            model_args=(data,), rng_key=key,
        )  # fmt: skip

        def step(state: Any, _: None) -> Any:
            state = advance(state, model_args=(data,), model_kwargs={})
            return state, (state.z, state.diverging)

        # one loop for both, which is compiled once; the samples of the warm-up are left out afterwards
        _, (places, lost) = jax.lax.scan(step, state, None, length=warm_up + each)
        return places[warm_up:], lost[warm_up:]

    # One after the other: side by side, each would go on until the longest path of all ends, both ways of every branch
    # would be computed, and what NumPyro nests would take seconds to trace.
    return jax.jit(lambda keys, z, data: jax.lax.map(lambda both: chain(both[0], both[1], data), (keys, z)))
