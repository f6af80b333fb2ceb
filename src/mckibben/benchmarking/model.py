"""Interface of models in the benchmark, and the models that there are."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ..errors import InputError
from ..muscles.law import TensionLaw
from ..muscles.laws import LAWS
from ..registry import Registry, is_reference, load_reference, named_by_person
from .datasets import BenchmarkRecord


@runtime_checkable
class BenchmarkModel(Protocol):
    """A model that takes part in the benchmark; any class with these two methods does.

    `fit` is called once for each fold, on a new fold with data that the model has not to remember. A model that cannot do
    a task raises `InputError` with the reason. The arrays of records cannot be written to: copy those that you change.

    Examples:
        >>> import numpy as np
        >>> import mckibben as mk
        >>> class Mean:
        ...     def fit(self, train):
        ...         self.value = np.mean(np.concatenate([r.outputs["tension"] for r in train]))
        ...     def predict(self, record):
        ...         return {"tension": np.full(len(record), self.value)}
        >>> from mckibben.benchmarking import run_task, task
        >>> chosen = task("map-above-4-bar")
        >>> run_task(chosen, chosen.load(), "mean", model=Mean()).rms() > 0.2
        True
    """

    def fit(self, train: Sequence[BenchmarkRecord]) -> object:
        """Learn from records with outputs; an output is NaN where it is hidden."""

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Predict the outputs of a record from its inputs, by name, each (n,) [SI]."""


def required_of_model(kind: object) -> str | None:
    """What something must be to take part; None where it does."""
    if isinstance(kind, type) and issubclass(kind, TensionLaw):
        return None
    if not isinstance(kind, type):
        return "a class with the methods fit and predict, or a tension law"
    missing = [name for name in ("fit", "predict") if not callable(getattr(kind, name, None))]
    return f"complete; missing: {', '.join(missing)}" if missing else None


# Models beside the tension laws, each in a module that is loaded on first use.
MODELS: Registry[Callable[[], BenchmarkModel]] = Registry(
    "mckibben.models",
    "model",
    {
        "friction": f"{__package__}.physics:FrictionModel",
        "friction_discrepancy": f"{__package__}.physics:FrictionDiscrepancy",
        "seated_braid_memory": f"{__package__}.physics:SeatedBraidMemory",
        "creep": f"{__package__}.physics:CreepModel",
        "robot_circuit": f"{__package__}.physics:RobotCircuit",
        "gaussian_process": f"{__package__}.regression:GaussianProcess",
        "perceptron": f"{__package__}.networks:Perceptron",
        "gru": f"{__package__}.networks:GatedRecurrentUnit",
        "neural_ode": f"{__package__}.networks:NeuralODE",
        "koopman": f"{__package__}.regression:ExtendedDMD",
    },
    accept=required_of_model,
)


# Models with physics beside the laws, and models without, to compare with.
PHYSICS = ("seated_braid_memory", "friction", "friction_discrepancy", "creep", "robot_circuit")
COMPETITORS = ("gaussian_process", "perceptron", "gru", "neural_ode", "koopman")


def model_names(*, competitors: bool = True) -> tuple[str, ...]:
    """Names of all models: the tension laws, then the others.

    Args:
        competitors: with those that know no physics.
    """
    return (*LAWS, *(name for name in MODELS if competitors or name not in COMPETITORS))


def new_model(name: str) -> BenchmarkModel:
    """An untrained model.

    Args:
        name: of a tension law or of a model, such as ``seated_braid``, ``my.py:MyLaw`` or ``my.py:MyModel``.

    Raises:
        InputError: there is none of that name, or it has not what the benchmark needs.
    """
    from .physics import LawModel

    named_by_person(name)
    if is_reference(name):
        kind: Any = load_reference(name, field="model")
        if inspect.isclass(kind) and issubclass(kind, TensionLaw):
            return LawModel(name)
        made = MODELS.find(name)
        try:
            return made()
        except Exception as error:
            words = (str(error).strip().splitlines() or [""])[0]
            problem = (
                f"must be a class that can be called without arguments, which raised {type(error).__name__}: {words}"
            )
            raise InputError("model", name, problem) from error
    if name in LAWS:
        return LawModel(name)
    return MODELS.find(name)()
