"""The least squares of a circuit's records, in scaled parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..components import paths
from ..engine.rates import RK4_LIMIT
from ..errors import ConvergenceError, InputError
from ..quantities import Quantity
from .trial import Trial, expand

DELAY = Quantity("s", (0.0, 1.0), "delay of the signal", "", (1e-4, 2e-2))


@dataclass(frozen=True)
class CircuitProblem:
    """The least squares in scaled parameters: the logarithm where a parameter is positive by nature, else its share."""

    trials: Sequence[Trial]
    paths: dict[str, tuple[str, ...]]
    quantities: tuple[Quantity, ...]
    first: np.ndarray
    size: np.ndarray
    models: tuple[Any, ...]

    @classmethod
    def of(
        cls, trials: Sequence[Trial], free: Sequence[str], start: Mapping[str, float], step: float
    ) -> CircuitProblem:
        """Set up from trials of one circuit, the free paths, first guesses [SI] and the step [s]; runs each trial once."""
        spread = expand(free, trials[0])
        for name in start:
            if name not in spread:
                raise InputError("start", name, f"it is not free; free are {', '.join(spread)}")
        quantities, first = [], []
        for name, many in spread.items():
            signal = many[0].startswith("signals.")
            quantities.append(DELAY if signal else paths.declaration(trials[0].circuit, many[0]))
            own = 1e-3 if signal else float(paths.get(trials[0].circuit, many[0]))
            first.append(float(start.get(name, own)))
            quantities[-1].check(name, first[-1])
        where = {p: first[i] for i, n in enumerate(spread) for p in spread[n]}
        groups = tuple(spread.values())
        models = []
        for trial in trials:
            run = trial.run(where, step=step)
            inner = max(1, int(np.ceil(trial.period / step - 1e-9)))
            # half of the limit is left for what the parameters will do on their way
            stiff = run.stiff or run.fastest * trial.period / inner > 0.5 * RK4_LIMIT
            models.append(trial.model(groups, inner, stiff))
        size = np.array(
            [abs(v) if v else max(abs(t) for t in q.typical) for v, q in zip(first, quantities, strict=True)]
        )
        return cls(trials, spread, tuple(quantities), np.asarray(first), size, tuple(models))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the free parameters, in order."""
        return tuple(self.paths)

    def logarithmic(self, i: int) -> bool:
        """Whether a parameter is positive by nature."""
        return self.quantities[i].bounds[0] > 0.0 and self.first[i] > 0.0

    def scaled(self, i: int, value: float) -> float:
        """A parameter's value as the solver sees it."""
        share = value / self.size[i]
        return float(np.log(share) if self.logarithmic(i) else share)

    def value(self, i: int, x: float) -> float:
        """A parameter [SI] from what the solver sees."""
        with np.errstate(over="ignore"):
            return float(self.size[i] * (np.exp(x) if self.logarithmic(i) else x))

    def values(self, x: np.ndarray) -> list[float]:
        """All of them."""
        return [self.value(i, v) for i, v in enumerate(x)]

    @property
    def start(self) -> np.ndarray:
        """First guesses, scaled."""
        return np.array([self.scaled(i, v) for i, v in enumerate(self.first)])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Declared bounds, scaled."""
        both = np.array([[self.scaled(i, b) for b in q.bounds] for i, q in enumerate(self.quantities)])
        return both[:, 0], both[:, 1]

    def residual(self, x: np.ndarray) -> np.ndarray:
        """All predictions less what was measured [SI], finite also where a run fails."""
        values = np.asarray(self.values(x))
        off = [
            m.predict(values) - np.stack(list(t.measured.values()))
            for m, t in zip(self.models, self.trials, strict=True)
        ]
        # a run that fails may be finite and beyond what can be squared
        return np.clip(np.nan_to_num(np.concatenate([o.ravel() for o in off]), nan=1e9), -1e9, 1e9)

    def split(self, residual: np.ndarray) -> list[np.ndarray]:
        """The residual by trial and channel."""
        lengths = [t.samples + 1 for t in self.trials for _ in t.channels]
        return np.split(residual, np.cumsum(lengths)[:-1])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Derivative of the residual to the scaled parameters.

        By forward tangents; delays are differenced over half a sample, because the instant of a switch has no derivative.
        """
        values = np.asarray(self.values(x))
        late = [n.endswith((".delay", ".dead_time")) for n in self.names]
        slopes = None if all(late) else np.concatenate([m.slopes(values).reshape(-1, len(values)) for m in self.models])
        columns = []
        for i in range(len(values)):
            if late[i] or slopes is None:
                columns.append(self._differenced(x, i))
            else:
                columns.append(slopes[:, i] * (self.value(i, x[i]) if self.logarithmic(i) else self.size[i]))
        return np.nan_to_num(np.stack(columns, axis=1))

    def _differenced(self, x: np.ndarray, i: int) -> np.ndarray:
        width = 0.5 * min(t.period for t in self.trials)
        value = self.value(i, x[i])
        low, high = (
            min(max(value + s * width, self.quantities[i].bounds[0]), self.quantities[i].bounds[1]) for s in (-1, 1)
        )
        ends = []
        for v in (low, high):
            moved = x.copy()
            moved[i] = self.scaled(i, v)
            ends.append(self.residual(moved))
        rate = (ends[1] - ends[0]) / (high - low)
        return rate * (value if self.logarithmic(i) else self.size[i])

    def solve(self, evaluations: int, progress: Callable[[str], None] | None) -> Any:
        """Least squares from the first guesses; SciPy's result."""
        from scipy import optimize

        low, high = self.bounds
        count = [0]

        def told(x: np.ndarray) -> np.ndarray:
            off = self.residual(x)
            count[0] += 1
            if progress is not None:
                progress(f"evaluation {count[0]}, rms {np.sqrt(np.mean(off**2)):.4g}")
            return off / scale

        scale = max(float(np.sqrt(np.mean(self.residual(self.start) ** 2))), 1e-12)
        if scale > 1e8:
            raise ConvergenceError("The circuit cannot be run with the first guesses; give others.")
        found = optimize.least_squares(
            told, np.clip(self.start, low + 1e-9, high - 1e-9), jac=lambda x: self.jacobian(x) / scale,
            bounds=(low, high), x_scale="jac", max_nfev=evaluations, xtol=1e-7, ftol=1e-9, gtol=1e-10,
        )  # fmt: skip
        return found
