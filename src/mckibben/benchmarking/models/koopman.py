"""Extended dynamic mode decomposition: one linear step of lifted outputs and inputs, run freely from the first outputs.

Source: M. O. Williams, I. G. Kevrekidis and C. W. Rowley, J. Nonlinear Science 25, 2015, doi:10.1007/s00332-015-9258-5;
with inputs: M. Korda and I. Mezic, Automatica 93, 2018, doi:10.1016/j.automatica.2018.03.046.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from ...errors import InputError
from ..records import BenchmarkRecord
from .columns import RecordColumns, held_back

MOST = 750  # samples of a record that are learned from
CHOICES = tuple(itertools.product((1, 2), (1e-6, 1e-4, 1e-2)))  # degree of the lifting, and ridge
REACH = 5.0  # standard deviations beyond which a free run is held


class ExtendedDMD:
    """Polynomial lifting of two outputs in a row and two inputs in a row; degree and ridge are chosen by free runs."""

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Choose degree and ridge by a free run over what is held back, then learn from all training samples.

        Raises:
            InputError: the records are not in time.
        """
        if any(record.is_static for record in train):
            raise InputError("task", None, "must be of records in time: a model of steps knows no static points")
        self.columns = RecordColumns.of(train, most=MOST)
        step, aside = self.columns.step, held_back(train)
        runs = [
            (self.columns.inputs(r)[::step], self.columns.targets(r)[::step], h[::step], self.columns.initial(r))
            for r, h in zip(train, aside, strict=True)
        ]
        errors = {}
        for choice in CHOICES:
            matrix = self._matrix(choice, [(u, np.where(h[:, None], np.nan, y)) for u, y, h, _ in runs])
            squares = [
                (self._free(choice[0], matrix, u[None], first[None])[0] - y)[h & np.isfinite(y).all(axis=1)] ** 2
                for u, y, h, first in runs
                if h.any()
            ]
            errors[choice] = float(np.mean(np.concatenate(squares)))
        self.chosen = min(errors, key=lambda choice: errors[choice])
        self.matrix = self._matrix(self.chosen, [(u, y) for u, y, _, _ in runs])

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Outputs of a free run; runs on thinned clocks begin one sample after the other."""
        step, count = self.columns.step, len(record)
        length = -(-count // step)
        inputs = self.columns.inputs(record)
        inputs = np.concatenate([inputs, np.repeat(inputs[-1:], length * step - count, axis=0)])
        inputs = inputs.reshape(length, step, -1).swapaxes(0, 1)
        first = np.tile(self.columns.initial(record), (step, 1))
        values = self._free(self.chosen[0], self.matrix, inputs, first)
        return self.columns.predicted(values.swapaxes(0, 1).reshape(length * step, -1)[:count])

    def _matrix(self, choice: tuple[int, float], runs: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Ridge regression of each output on what was lifted one step before (lifted, outputs)."""
        degree, ridge = choice
        known = [(np.concatenate([y[1:-1], y[:-2], u[2:], u[1:-1]], axis=1), y[2:] - y[1:-1]) for u, y in runs]
        states = np.concatenate([state for state, _ in known])
        changes = np.concatenate([change for _, change in known])
        shown = np.isfinite(states).all(axis=1) & np.isfinite(changes).all(axis=1)
        lifted = lift(states[shown], degree)
        gram = lifted.T @ lifted / len(lifted)
        gram[np.diag_indices_from(gram)] += ridge
        return np.linalg.solve(gram, lifted.T @ changes[shown] / len(lifted))

    def _free(self, degree: int, matrix: np.ndarray, inputs: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Free runs (runs, n, outputs) from first outputs (runs, outputs) with inputs (runs, n, inputs)."""
        before = now = first
        values, earlier = [now], inputs[:, 0]
        for at in range(1, inputs.shape[1]):
            current = inputs[:, at]
            change = lift(np.concatenate([now, before, current, earlier], axis=1), degree) @ matrix
            before, now, earlier = now, np.clip(now + change, -REACH, REACH), current
            values.append(now)
        return np.stack(values, axis=1)


def lift(states: np.ndarray, degree: int) -> np.ndarray:
    """One, the states (n, d), and their products for degree 2 (n, lifted)."""
    columns = [np.ones((len(states), 1)), states]
    if degree == 2:
        i, j = np.triu_indices(states.shape[1])
        columns.append(states[:, i] * states[:, j])
    return np.concatenate(columns, axis=1)
