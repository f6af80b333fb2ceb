"""What a model of the benchmark is shown: records of inputs and outputs, in folds of training and test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError


def _protected(values: np.ndarray) -> np.ndarray:
    """A view that cannot be written to."""
    view = np.asarray(values).view()
    view.setflags(write=False)
    return view


@dataclass(frozen=True)
class BenchmarkRecord:
    """Inputs and outputs of one muscle, or one system, at points or over time.

    Attributes:
        name: of the record.
        muscle: that was measured; what several records share.
        inputs: by name, SI, each (n,).
        outputs: by name, SI, each (n,); empty where a model is to predict them.
        dimensions: of the muscle [SI], such as ``rest_length``.
        time: of the samples [s], (n,); None for static points.
        initial: first value of each output over time, by name; empty for static points.
        phase: in which part of a run each sample lies, such as ``filling``, (n,); None if there is one only.

    Examples:
        >>> import numpy as np
        >>> from mckibben.benchmarking import BenchmarkRecord
        >>> inputs = {"length": np.array([0.1, 0.1]), "pressure": np.array([1e5, 2e5])}
        >>> BenchmarkRecord("made up", "A", inputs, {"tension": np.array([10.0, 20.0])}).unseen().outputs
        {}
    """

    name: str
    muscle: str
    inputs: Mapping[str, np.ndarray]
    outputs: Mapping[str, np.ndarray] = field(default_factory=dict)
    dimensions: Mapping[str, float] = field(default_factory=dict)
    time: np.ndarray | None = None
    initial: Mapping[str, float] = field(default_factory=dict)
    phase: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Protect the arrays, so that no model changes what others are scored on."""
        for name in ("inputs", "outputs"):
            object.__setattr__(self, name, {key: _protected(values) for key, values in getattr(self, name).items()})
        for name in ("time", "phase"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _protected(getattr(self, name)))

    def __getattr__(self, name: str) -> object:
        """Say what a record has where a model asks for something else."""
        known = [
            f"{group}[{key!r}]" for group in ("inputs", "outputs", "dimensions") for key in vars(self).get(group, ())
        ]
        raise AttributeError(
            f"BenchmarkRecord has no attribute {name!r}; this record has {', '.join(known)}, time and initial"
        )

    def __len__(self) -> int:
        return len(next(iter(self.inputs.values())))

    @property
    def is_static(self) -> bool:
        """Whether the samples are points without an order in time."""
        return self.time is None

    def unseen(self) -> BenchmarkRecord:
        """The record without its outputs, as a model sees it that has to predict them."""
        return replace(self, outputs={})

    def select(self, keep: np.ndarray) -> BenchmarkRecord:
        """The samples where `keep` is true, bool (n,)."""
        return replace(
            self,
            inputs={name: values[keep] for name, values in self.inputs.items()},
            outputs={name: values[keep] for name, values in self.outputs.items()},
            time=None if self.time is None else self.time[keep],
            phase=None if self.phase is None else self.phase[keep],
        )

    def every(self, step: int) -> BenchmarkRecord:
        """Every `step`-th sample, from the first."""
        return self.select(np.arange(len(self)) % step == 0)

    def features(self) -> np.ndarray:
        """Inputs in the order of their names, then the rest length if it is known, as columns (n, features)."""
        columns = [self.inputs[name] for name in sorted(self.inputs)]
        if "rest_length" in self.dimensions:
            columns.append(np.full(len(self), self.dimensions["rest_length"]))
        return np.stack(columns, axis=1)


@dataclass(frozen=True)
class DataSplit:
    """A frozen split: what a model may see, and what it has to predict.

    Attributes:
        name: what is left out, such as ``DMSP-10-250, 3 bar``.
        train: records with outputs.
        test: records with outputs, which the model gets `unseen`.
        scored: which samples of each test record count, bool (n,) each; a model may see the inputs of the others.
    """

    name: str
    train: tuple[BenchmarkRecord, ...]
    test: tuple[BenchmarkRecord, ...]
    scored: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        """Refuse a fold without data."""
        if not self.train or not self.test or len(self.test) != len(self.scored):
            raise InputError("fold", self.name, "must have records to train on, and a mask for each to predict")
