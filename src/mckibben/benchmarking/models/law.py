"""A tension law as a model of the benchmark: fitted to the static points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...errors import InputError
from ...identification.problem import SAME_LENGTH, Problem, solve
from ...muscles.build import build_law
from ...muscles.law import TensionLaw
from ...muscles.laws import law_type
from ...quantities import declared
from ...recordings import ForceMap
from ..records import BenchmarkRecord

RULER = 3e-4  # standard deviation of a length set to the half millimetre: 0.5 mm over the square root of three [m]


class LawModel:
    """A tension law with its own choice of free parameters.

    Args:
        law: its name, such as ``seated_braid`` or ``my.py:MyLaw``.
        length_error: standard deviation of the error of each set length [m], used where muscles of several rest lengths are
            to train on; by default `RULER` for a law with priors, none for others.
    """

    def __init__(self, law: str, *, length_error: float | None = None) -> None:
        default = RULER if law_type(law).priors else 0.0
        self.law, self.length_error = law, default if length_error is None else length_error
        self._near: dict[tuple[str, ...], np.ndarray] = {}

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit the free parameters; a search from many starts precedes the first fold only.

        Raises:
            InputError: the records are not of tension over length and pressure, or too few.
            ConvergenceError: no fit converged.
        """
        train = thinned(train)
        self.points = joined(train)
        shared = dict(train[0].dimensions)
        for record in train[1:]:
            shared = {k: v for k, v in shared.items() if record.dimensions.get(k) == v}
        self.known = {k: v for k, v in shared.items() if k != "rest_length"}
        rest = self.points.rest_length
        errors = self.length_error if rest is not None and np.ptp(rest) > SAME_LENGTH else 0.0
        problem = Problem.of(self.law, self.points, known=self.known, length_error=errors)
        near = self._near.get(problem.free)
        solution = solve(problem, near=[] if near is None else [near], search=near is None)
        if not solution.converged:
            solution = solve(problem)
        self._near[problem.free] = solution.scaled
        self.values = solution.values(problem)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Tension at the lengths and pressures of a record; the law knows no time."""
        length, pressure = record.inputs["length"], record.inputs["pressure"]
        return {"tension": np.asarray(self.law_for(record).tension(length, pressure))}

    def law_for(self, record: BenchmarkRecord) -> TensionLaw:
        """The fitted law with the dimensions of the muscle of a record."""
        length = record.inputs["length"]
        fields = declared(law_type(self.law))
        known: dict[str, float] = {k: v for k, v in record.dimensions.items() if k in fields and k not in self.values}
        if "upper_length" in fields:
            seen = self.points.length if self.points.rest_length is None else length
            known["upper_length"] = float(max(np.max(length), np.max(seen)))
        return build_law(self.law, known | self.values)


MOST = 3000  # samples of records in time that a law is fitted to; more of them say the same


def thinned(train: Sequence[BenchmarkRecord], most: int = MOST) -> list[BenchmarkRecord]:
    """Static records as they are, and of records in time as many evenly spaced samples as sum up to `most`."""
    count = sum(len(record) for record in train if not record.is_static)
    step = -(-count // most)
    return [record if record.is_static else record.every(step) for record in train]


def joined(train: Sequence[BenchmarkRecord]) -> ForceMap:
    """The points of records as one force map.

    Raises:
        InputError: the records are not of tension over length and pressure.
    """
    for record in train:
        if "tension" not in record.outputs or not {"length", "pressure"} <= set(record.inputs):
            raise InputError("task", None, "must be of tension from length and pressure: a tension law knows no other")
    whole = np.concatenate([np.full(len(r), r.dimensions.get("rest_length", np.nan)) for r in train])
    return ForceMap(
        name="training data",
        length=np.concatenate([record.inputs["length"] for record in train]),
        pressure=np.concatenate([record.inputs["pressure"] for record in train]),
        tension=np.concatenate([record.outputs["tension"] for record in train]),
        rest_length=whole if np.isfinite(whole).all() else None,
    )
