"""Seated braid with friction and creep in its braid, as a model of the benchmark for records in time.

A muscle between fixed anchors still moves inside: as the tension rises its ends settle, by u, and its braid shortens. Bouc
and Wen's friction and Maxwell elements resist that motion,

    F = F_law(L, P') + f(z) + sum k_i e_i,      both driven by -du

The law is fitted first, to all samples; then friction, with or without the elements, to what it leaves, as the muscle that
is held back among those to train on says. What friction does to the settling itself is of second order and left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...errors import InputError
from ...identification.shared_hysteresis import NAMES, BraidPath, ResistanceProblem, braid_path, resistance
from ..records import BenchmarkRecord
from .columns import held_back
from .law import LawModel

MOST = 750  # samples of a record that friction is fitted to


class SeatedBraidMemory:
    """Law, friction with memory and creep, with the settling of the ends as the motion that both resist."""

    def __init__(self) -> None:
        self.static = LawModel("seated_braid")

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit the law, then friction and creep.

        Raises:
            InputError: the records are not of tension in time.
            ConvergenceError: the law could not be fitted.
        """
        if any(record.is_static for record in train):
            raise InputError("task", None, "must be of records in time: without time this is the law alone")
        self.static.fit(train)
        step = -(-max(len(record) for record in train) // MOST)
        thin = [record.every(step) for record in train]
        held = [h[::step] for h in held_back(train)]
        paths = [self.path_of(record) for record in thin]
        left = [record.outputs["tension"] - path[0] for record, path in zip(thin, paths, strict=True)]
        taut = [record.outputs["tension"] > 0.0 for record in thin]
        errors, used = [], [t & ~h for t, h in zip(taut, held, strict=True)]
        for creeps in (False, True):
            values = fit_memory(paths, left, used, creeps)
            rest = np.concatenate(
                [(resistance(values, p) - r)[t & h] for p, r, t, h in zip(paths, left, taut, held, strict=True)]
            )
            errors.append(float(np.mean(rest**2)))
        self.creeps = errors[1] < errors[0]
        self.values = fit_memory(paths, left, taut, self.creeps)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Tension over time from length and pressure, never a push."""
        path = self.path_of(record)
        return {"tension": np.maximum(path.tension + resistance(self.values, path), 0.0)}

    def path_of(self, record: BenchmarkRecord) -> BraidPath:
        """Path of the braid of a record, with the settling of its ends."""
        if record.time is None:
            raise InputError("task", None, "must be of records in time")
        law = self.static.law_for(record)
        return braid_path(law, record.inputs["length"], record.inputs["pressure"], record.time)


def fit_memory(
    paths: Sequence[BraidPath], left: Sequence[np.ndarray], used: Sequence[np.ndarray], creeps: bool
) -> np.ndarray:
    """Parameters by least squares of what the law leaves, without creep or with it."""
    return ResistanceProblem(paths, left, used).fit(NAMES if creeps else NAMES[:3])
