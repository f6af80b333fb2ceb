"""Variables of an FMU: the numbers at the border of a part with names, value references and places in the C struct."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ..c_source import PartSource, PartVariable

NOMINALS = {"kg": 1e-3, "Pa": 1e5, "m": 0.1, "m/s": 0.1}  # usual size of a state by its unit; 1 otherwise
NOT_OFFERED = ("sound",)  # outputs that are errors of a step in FMI
MEANINGS = {
    "tension": "mean tension over the communication step: step the muscle first, then the mechanism with this tension in "
    "the same step; in model exchange the present tension",
    "rate": "rate of the span; without it the muscle takes the span as constant over a step",
}


class FmuVariable(NamedTuple):
    """A variable of an FMU, perhaps an array.

    Attributes:
        reference: value reference; each element has one of its own in FMI 2.0, the following ones.
        name: by which users find it.
        kind: ``INPUT``, ``OUTPUT``, ``FIXED`` or ``TUNABLE`` parameter, ``STATE`` or ``RATE``.
        member: of the C struct of the instance, such as ``inputs.span_muscle``.
        unit: SI unit; empty where none is declared.
        bounds: least and largest value, infinite where there is none.
        meaning: one phrase.
        start: value at the start; None where it is calculated.
        shape: () for a number.
        nominal: usual size of a state.
        silent: values of an input from and to which no warning is logged.
        state: reference of the state that a rate belongs to.
    """

    reference: int
    name: str
    kind: str
    member: str
    unit: str
    bounds: tuple[float, float]
    meaning: str
    start: float | list[float] | None = None
    shape: tuple[int, ...] = ()
    nominal: float | None = None
    silent: tuple[float, float] = (-math.inf, math.inf)
    state: int | None = None

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)

    def starts(self) -> list[float]:
        """Values at the start, element by element; empty where they are calculated."""
        return [] if self.start is None else np.ravel(self.start).tolist()


def fmu_variables(source: PartSource, *, states: bool) -> list[FmuVariable]:
    """The variables of a part, with value references from 1 on; 0 is the time.

    Args:
        source: the C of the part.
        states: whether continuous states and their rates are variables, as model exchange needs.

    Raises:
        InputError: two variables have the same name.
    """
    made: list[FmuVariable] = []
    next_free = 1
    for variable in _unnumbered(source, states):
        made.append(variable._replace(reference=next_free))
        next_free += variable.size
    references = {v.name: v.reference for v in made}
    numbered = [v._replace(state=references[v.name[4:-1]]) if v.kind == "RATE" else v for v in made]
    names = [v.name for v in numbered]
    for name in names:
        if names.count(name) > 1:
            raise InputError("muscles", None, f"must have other names: two variables would be called {name}")
    return numbered


def _unnumbered(source: PartSource, states: bool) -> Iterator[FmuVariable]:
    several = len(source.part.muscles) > 1
    for variable in source.of("inputs"):
        what, _, whose = variable.path.partition(".")
        name = variable.path if what == "command" else f"{whose}.{what}" if several else what
        made = _of(variable, name, "INPUT", MEANINGS.get(what, variable.meaning))
        yield made._replace(silent=source.part.command_limits(whose)) if what == "command" else made
    for variable in source.of("outputs"):
        words = variable.path.split(".")
        what, whose = (words[2], words[1]) if words[0] == "muscle" else (words[0], words[1] if len(words) > 1 else "")
        if what in NOT_OFFERED:
            continue
        name = f"{whose}.{what}" if several and whose else what
        yield _of(variable, name, "OUTPUT", MEANINGS.get(what, variable.meaning))._replace(start=None)
    meaning = (
        "0: rates belong to the time of the spans; 1: they are half a step older, as in a semi-implicit Euler method"
    )
    yield FmuVariable(0, "staggered", "FIXED", "staggered", "1", (0.0, 1.0), meaning, 0.0)
    for variable in source.of("parameters"):
        fixed = variable.path.startswith("start.")
        yield _of(variable, variable.path, "FIXED" if fixed else "TUNABLE", variable.meaning)
    if not states:
        return
    rates = source.of("rates")
    paths = {f"physics.{rate.path}" for rate in rates}
    for variable in source.of("state"):
        if variable.path in paths:
            name = variable.path.replace("physics.", "state.", 1)
            yield _of(variable, name, "STATE", variable.meaning)._replace(nominal=NOMINALS.get(variable.unit, 1.0))
    for rate in rates:
        yield _of(rate, f"der(state.{rate.path})", "RATE", rate.meaning)


def _of(variable: PartVariable, name: str, kind: str, meaning: str) -> FmuVariable:
    return FmuVariable(
        0,
        name,
        kind,
        f"{variable.group}.{variable.member}",
        variable.unit,
        variable.bounds,
        meaning,
        variable.default,
        variable.shape,
    )
