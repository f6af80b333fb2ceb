"""What all other rows say of a printed number: inputs that are not printed are inferred without it, and it is predicted.

Rows that depend on the same inputs form a `Network`. To predict one of them, the inputs are inferred from the others by
least squares within stated bounds, each row in units of what counts as agreement, an interval by its distance from it:

    min over x of  sum ((v_i(x) - p_i) / h_i)^2  over all i but the one
    C = (A' A + diag(12/(high - low)^2))^-1,     A = dv_i/dx / h_i          covariance of the inputs, bounds as even priors
The others and the bounds leave the prediction sqrt(g C g'), one standard deviation; g is its sensitivity. Where that is more
than `LEFT` times what counts as agreement, the others do not tell the row, and agreement would say nothing.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from mckibben.estimation import Parameter, Parameters, bounds_of, descend

from .rows import PrintedRow, accepted_band, agrees, in_row_unit, rows_by_name

LEFT = 2.0  # a prediction that the other rows leave within more than so many half tolerances is none
NEWTON = 5  # steps to the input that would give the print
SEEN = 1e-6  # share of a row by which an input must be able to change it

Inputs = Mapping[str, float]
Model = Callable[[Inputs], float]


@dataclass(frozen=True, eq=False)
class Network:
    """Rows that depend on the same inferred inputs.

    Attributes:
        inputs: by their names in words, in the units of the papers, with bounds and where they begin.
        models: value of each row by the inputs [SI].
        targets: middle and half width [SI] of what else tells the inputs, or of rows that tell them more closely than their
            tolerance, by the names of their models.
        together: sets of rows of which all are left out with any: the same number in another place, or one experiment.
        silent: rows that are predicted and tell nothing.
        rounds: in which values and slopes are taken anew; of one the slopes are those of the start.
        step: of the differences by which slopes are taken, over where an input begins.
        steps: these steps of inputs that need another one, in their unit.
        linear: values are taken of the slopes, for each costs recordings; other networks compute them.
        through: factor by which the test machine reads a row otherwise than it tells the inputs.
    """

    inputs: Parameters
    models: Mapping[str, Model]
    targets: Mapping[str, Callable[[], tuple[float, float]]] = field(default_factory=dict)
    together: tuple[frozenset[str], ...] = ()
    silent: frozenset[str] = frozenset()
    rounds: int = 3
    step: float = 1e-3
    steps: Mapping[str, float] = field(default_factory=dict)
    linear: bool = False
    through: Mapping[str, Callable[[], float]] = field(default_factory=dict)

    @functools.cached_property
    def start(self) -> np.ndarray:
        """Inputs where they begin, as the solver sees them (p,)."""
        return np.array([p.scaled(p.start) for p in self.inputs.values()])

    def value(self, name: str, x: np.ndarray) -> float:
        """Value of a row [its unit] at scaled inputs (p,)."""
        first = tuple(self.start if self.linear else x)
        return float(self._value(name, first) + self.slope(name, x) @ (x - first))

    def slope(self, name: str, x: np.ndarray) -> np.ndarray:
        """Derivative of a row [its unit] by the scaled inputs (p,), there or where they begin."""
        return self._slope(name, tuple(self.start if self.linear or self.rounds == 1 else x))

    @functools.cache  # noqa: B019 - networks live as long as the process
    def _value(self, name: str, x: tuple[float, ...]) -> float:
        inputs = {n: float(p.value(v)) for (n, p), v in zip(self.inputs.items(), x, strict=True)}
        return in_row_unit(name, self.models[name](inputs))

    @functools.cache  # noqa: B019
    def _slope(self, name: str, x: tuple[float, ...]) -> np.ndarray:
        slopes = []
        for i, (n, p) in enumerate(self.inputs.items()):
            now, step = float(p.value(x[i])), self.steps.get(n, self.step * abs(p.start))
            there = p.scaled(now + (step if now + step <= p.high else -step))
            moved = (*x[:i], there, *x[i + 1 :])
            slopes.append((self._value(name, moved) - self._value(name, x)) / (there - x[i]))
        return np.array(slopes)

    def target(self, name: str) -> tuple[float, float, bool]:
        """Middle and half width of what a row or another model tells [its unit], and whether it is an interval."""
        if name in self.targets:
            middle, half = (in_row_unit(name, v) for v in self.targets[name]())
            return middle, half, False
        row = rows_by_name()[name]
        band = accepted_band(row)
        assert band is not None, name
        return *band, isinstance(row.paper, tuple)


class NeededInput(NamedTuple):
    """The input that would have to change for a prediction to be what is printed, in the unit of the papers.

    Attributes:
        name: in words.
        now: as inferred from the other rows.
        spread: that these and its bounds leave, one standard deviation.
        value: that it would need.
        unit: of these.
        beyond: whether that lies outside of its bounds.
    """

    name: str
    now: float
    spread: float
    value: float
    unit: str
    beyond: bool

    def __str__(self) -> str:
        where = ", beyond its bounds" if self.beyond else ""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return (
            f"{self.name} would have to be {self.value:.5g} instead of {self.now:.5g} +-{self.spread:.2g}{unit}{where}"
        )


@dataclass(frozen=True)
class RowPrediction:
    """A row, predicted from all others.

    Attributes:
        value: predicted [the row's unit].
        spread: one standard deviation that the others leave [the row's unit].
        told: whether they tell the row.
        by: names of the other rows, as far as the inputs change them.
        inputs: on which the row depends, inferred without it, by name: value, its standard deviation, unit, and the row's
            sensitivity to it [the row's unit per unit].
        needed: what would have to change for it to be as printed; None where it agrees, or nothing changes it.
    """

    value: float
    spread: float
    told: bool
    by: tuple[str, ...]
    inputs: dict[str, tuple[float, float, str, float]]
    needed: NeededInput | None

    def words(self, row: PrintedRow) -> str:
        """Say of what the row is predicted, its sensitivity to each input, and what would have to change."""
        unit, inputs = "" if row.unit == "-" else f" {row.unit}", self.inputs_text(row)
        others = f"{len(self.by)} other row{'s' if len(self.by) != 1 else ''}"
        said = f"predicted +-{self.spread:.2g}{unit} from {others}: {inputs}"
        if not self.told:
            said = f"told by {others} within +-{self.spread:.2g}{unit} only: {inputs}"
        if not self.by:
            said = f"no other row tells it, and the bounds leave +-{self.spread:.2g}{unit}: {inputs}"
        return f"{self.needed}; {said}" if self.needed else said

    def inputs_text(self, row: PrintedRow) -> str:
        """The inferred inputs with what is left to them, and in brackets the sensitivity of the row to each."""
        unit, parts = "" if row.unit == "-" else f" {row.unit}", []
        for name, (value, spread, of, slope) in self.inputs.items():
            shown, per = ("", "") if of == "1" else (f" {of}", f" per {of}")
            parts.append(f"{name} {value:.4g} +-{spread:.2g}{shown} ({slope:+.3g}{unit}{per})")
        return ", ".join(parts)


def infer(network: Network, left_out: frozenset[str] = frozenset()) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Infer the inputs from all rows but some.

    Returns:
        Scaled inputs (p,), their covariance (p, p), and names of the rows that tell them.
    """
    low, high = bounds_of(network.inputs)
    names = [n for n in network.models if n not in left_out | network.silent]
    names = [n for n in names if _moves(network, n).any()]
    targets = [network.target(n) for n in names]
    middle, half = (np.array([t[i] for t in targets]) for i in (0, 1))
    interval = np.array([t[2] for t in targets], bool)

    def slopes_at(x: np.ndarray) -> np.ndarray:
        return np.array([network.slope(n, x) for n in names]).reshape(len(names), len(low))

    def misses(values: np.ndarray) -> np.ndarray:
        away = (values - middle) / half
        missed: np.ndarray = np.where(interval, np.sign(away) * np.maximum(np.abs(away) - 1.0, 0.0), away)
        return missed

    x = network.start
    for _ in range(1 if network.linear else network.rounds):
        if not names:
            break
        first, slopes = np.array([network.value(n, x) for n in names]), slopes_at(x)
        first = first - slopes @ x

        def residual(y: np.ndarray, first: np.ndarray = first, slopes: np.ndarray = slopes) -> np.ndarray:
            return misses(first + slopes @ y)

        def jacobian(y: np.ndarray, first: np.ndarray = first, slopes: np.ndarray = slopes) -> np.ndarray:
            inside = interval & (misses(first + slopes @ y) == 0.0)
            rows: np.ndarray = np.where(inside, 0.0, 1.0 / half)[:, None] * slopes
            return rows

        x = descend(residual, x, jacobian=jacobian, bounds=(low, high), margin=1e-9).x
    # an interval tells an input evenly: as wide as a standard deviation of 1/sqrt(3) of its half width
    rows = (np.where(interval, np.sqrt(3.0), 1.0) / half)[:, None] * slopes_at(x)
    covariance = np.linalg.inv(rows.T @ rows + np.diag(12.0 / (high - low) ** 2))
    return x, covariance, tuple(names)


def _moves(network: Network, name: str) -> np.ndarray:
    """Which inputs can change a row within their bounds (p,)."""
    (low, high), start = bounds_of(network.inputs), network.start
    moved: np.ndarray = np.abs(network.slope(name, start)) * (high - low) > SEEN * abs(network.value(name, start))
    return moved


@functools.cache
def predict(network: Network, name: str) -> RowPrediction:
    """Predict a row of a network from all its others."""
    row = rows_by_name()[name]
    out = frozenset((name,)).union(*(some for some in network.together if name in some))
    x, covariance, by = infer(network, out)
    factor = network.through[name]() if name in network.through else 1.0
    slope, value = factor * network.slope(name, x), factor * network.value(name, x)
    spread, deviations = float(np.sqrt(slope @ covariance @ slope)), np.sqrt(np.diag(covariance))
    inputs = {}
    moves = _moves(network, name)
    for (n, p), at, deviation, by_scaled in itertools.compress(
        zip(network.inputs.items(), x, deviations, slope, strict=True), moves
    ):
        now = float(p.value(at))
        per = float(p.value(at + 1e-6) - p.value(at - 1e-6)) / 2e-6  # unit of the input per scaled input
        inputs[n] = (now, float(deviation * per), p.unit, float(by_scaled / per))
    band = accepted_band(row)
    assert band is not None, name
    told = spread <= LEFT * band[1] and bool(by)
    inside = isinstance(row.paper, tuple) and agrees(row, value)
    needed = None if inside or (told and agrees(row, value)) else _needed(network, row, x, deviations, factor)
    return RowPrediction(value, spread, told, by, inputs, needed)


def _needed(
    network: Network, row: PrintedRow, x: np.ndarray, deviations: np.ndarray, factor: float
) -> NeededInput | None:
    """The input that changes least, over what is left to it, for the row to be as printed."""
    ends = row.paper if isinstance(row.paper, tuple) else (row.paper,)
    best: tuple[float, NeededInput] | None = None
    for i, (name, p) in itertools.compress(enumerate(network.inputs.items()), _moves(network, row.id)):
        y = x.copy()
        for _ in range(1 if network.linear else NEWTON):
            ours = factor * network.value(row.id, y)
            y[i] += (min(ends, key=lambda end, ours=ours: abs(ours - end)) - ours) / (
                factor * network.slope(row.id, y)[i]
            )
        change = abs(y[i] - x[i]) / deviations[i]
        spread = float(p.value(x[i] + deviations[i]) - p.value(x[i] - deviations[i])) / 2.0
        beyond = not p.scaled(p.low) <= y[i] <= p.scaled(p.high)
        found = NeededInput(name, float(p.value(x[i])), spread, float(p.value(y[i])), p.unit, beyond)
        if np.isfinite(change) and (best is None or change < best[0]):
            best = change, found
    return None if best is None else best[1]


def make_parameter(start: float, low: float, high: float, unit: str, *, log: bool = False) -> Parameter:
    """An inferred input with its bounds, in the unit of the papers; `log` where it ranges over orders of magnitude."""
    return Parameter(start, low, high, unit, size=abs(start) or 1.0, search="log" if log else "share")
