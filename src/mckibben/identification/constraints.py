"""Parameters from printed numbers instead of a table: "323 N per rest length at 5 bar, free at 0.75 L0".

A paper rarely prints enough of them. What the constraints leave open is said in words and in infinite intervals, and the
solution then follows from the starting values, which is a choice and no finding.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, jax, jnp
from ..answers import Answer, Caution, Table, estimates
from ..documents import JsonValue, read_toml
from ..errors import ConvergenceError, InputError, each_once
from ..estimation import Estimate, Estimation, Parameter, determined, open_groups
from ..muscles.build import construct, required_fields
from ..muscles.law import TensionLaw
from ..muscles.laws import law_type
from ..quantities import declared, parse
from ..verbs import ConstraintsFile, verb

KINDS = {"tension": "N", "stiffness": "N/m", "free_length": "m", "volume": "m^3"}


class Constraint(NamedTuple):
    """A printed number to be met.

    Attributes:
        what: ``tension``, ``stiffness``, ``free_length`` or ``volume``.
        value: printed value [N, N/m, m or m^3].
        pressure: gauge pressure it holds at [Pa].
        length: length it holds at [m]; a free length needs none.
    """

    what: str
    value: float
    pressure: float
    length: float | None = None

    def of(self, law: TensionLaw) -> Scalar:
        """Value of the number according to a law [SI]."""
        if self.what == "free_length":
            return law.free_length(self.pressure)
        formula = {"tension": law.braid_tension, "stiffness": law.braid_stiffness, "volume": law.braid_volume}[
            self.what
        ]
        assert self.length is not None  # only the free length has none
        return formula(self.length, self.pressure)


@dataclass(frozen=True)
class ConstrainedFit(Answer):
    """Parameters that meet the constraints; an interval is infinite where the constraints leave the parameter open.

    Attributes:
        law: name of the law.
        parameters: that were solved for [SI].
        known: that were taken as given [SI].
        count: of the constraints.
        cautions: what the constraints leave open.
    """

    law: str
    parameters: dict[str, Estimate]
    known: dict[str, float]
    count: int
    cautions: tuple[Caution, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the constraints leave open, as text."""
        return tuple(one.text for one in self.cautions)

    def to_dict(self) -> dict[str, JsonValue]:
        """Law and parameters as one entry of ``fits``, as a fit to a table has them."""
        parameters = {name: e._asdict() for name, e in self.parameters.items()}
        entry = {"law": self.law, "parameters": parameters, "known": self.known, "n": self.count}
        return {"fits": [entry | {"warnings": list(self.warnings)}]}

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per parameter."""
        return [{"parameter": name} | e._asdict() for name, e in self.parameters.items()]

    def tables(self) -> list[Table]:
        """The parameters; those that the constraints leave open say so."""
        open_ = {name: "not determined" for name, e in self.parameters.items() if e.low != e.high}
        return [estimates(f"{self.law}, from {self.count} printed constraints", self.parameters, more=open_)]

    def build(self) -> TensionLaw:
        """The law."""
        return construct(law_type(self.law), self.known | {k: e.value for k, e in self.parameters.items()})


def fit_constraints(
    law: str,
    constraints: Sequence[Constraint],
    *,
    known: Mapping[str, float],
    start: Mapping[str, float] | None = None,
    free: tuple[str, ...] | None = None,
) -> ConstrainedFit:
    """Solve printed constraints for the parameters of a law.

    Args:
        law: name of the law.
        constraints: printed numbers.
        known: parameters taken as given [SI].
        start: starting values of free parameters [SI]; the middle of their usual range by default.
        free: which to solve for; those that a fit of this law frees and that are not known, by default.

    Raises:
        InputError: if a constraint is incomplete or a parameter neither known nor free.
        ConvergenceError: if the constraints contradict each other or the law.
    """
    kind = law_type(law)
    fields = declared(kind)
    free = free or tuple(name for name in kind.fitted if name not in known)
    _check(law, constraints, free, known)
    printed = np.array([c.value for c in constraints])
    errors = np.maximum(np.abs(printed), 1e-12)
    parameters = {}
    for name in free:
        q = fields[name]
        low, high = q.typical
        begin = float(np.sqrt(low * high)) if low > 0 else 0.5 * (low + high)
        if q.unit == "m" and low <= known.get("rest_length", np.nan) <= high:
            begin = 0.7 * known["rest_length"]  # a length of the braid goes with that of the muscle
        begin = (start or {}).get(name, begin)
        size = max(abs(begin), 1e-3 * max(map(abs, q.typical)))
        parameters[name] = Parameter(begin, *q.bounds, q.unit, size)

    sizes = np.array([p.size for p in parameters.values()])

    def misfit(x: Scalar) -> Any:
        built = construct(kind, dict(known) | dict(zip(parameters, x * sizes, strict=True)))
        return (jnp.stack([jnp.asarray(c.of(built)) for c in constraints]) - printed) / errors

    value, slopes = jax.jit(misfit), jax.jit(jax.jacfwd(misfit))
    exact = {"x_scale": 1.0, "xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
    estimation = Estimation(parameters, lambda x: np.asarray(value(x)), lambda x: np.asarray(slopes(x)), 0.0, exact)
    at = estimation.descend(np.array([p.scaled(p.start) for p in parameters.values()])).x
    left = float(np.abs(np.asarray(value(at))).max())
    if not left < 1e-6:
        raise ConvergenceError(
            f"{law}: no parameters meet the constraints; the nearest ones miss by {100 * left:.3g} %"
        )
    directions = determined(np.asarray(slopes(at)))[2]
    open_ = sorted({free[i] for group in open_groups(directions) for i in group})
    solved = {}
    for (name, p), x in zip(parameters.items(), at, strict=True):
        meets = float(p.value(x))
        ends = (-np.inf, np.inf) if name in open_ else (meets, meets)
        solved[name] = Estimate(meets, *ends, p.unit)
    warnings = (
        f"{len(directions)} independent constraints of {len(constraints)} leave {len(free) - len(directions)} of "
        f"{len(free)} parameters open: they cannot tell {', '.join(open_)} apart",
        "the values given follow from the starting values; they are a choice and no finding",
    )
    cautions = tuple(Caution(one) for one in warnings if open_)
    return ConstrainedFit(law, solved, dict(known), len(constraints), cautions)


@verb
def fit_printed(file: ConstraintsFile) -> ConstrainedFit:
    """Solve a file of printed numbers for the parameters of a law.

    Args:
        file: path of a .toml file with the name of a ``law``, a table ``[known]`` of its given parameters, and one table
            ``[[constraint]]`` for each number: ``what`` it is, ``value``, ``pressure`` and, where it needs one, ``length``.

    Raises:
        InputError: names file, table and value.
        ConvergenceError: the numbers contradict each other or the law.
    """
    where = str(file)

    def word(entry: Mapping[str, Any], key: str, place: str = "") -> str:
        if not isinstance(entry.get(key), str):
            raise InputError(f"{place}{key}", entry.get(key), "must be a name", where=where)
        return str(entry[key])

    def only(entry: Mapping[str, Any], allowed: Iterable[str], place: str) -> None:
        for key in entry:
            if key not in allowed:
                raise InputError(f"{place}.{key}", None, known=sorted(allowed), where=where)

    def value(text: Any, place: str, unit: str) -> float:
        return parse(str(text), unit, field=place, where=where)

    data = read_toml(Path(file))
    only(data, {"law", "known", "constraint"}, "file")
    if not data.get("constraint"):
        raise InputError("constraint", None, "is missing: the file needs one [[constraint]] or more", where=where)
    law = word(data, "law")
    fields, known, constraints = declared(law_type(law)), {}, []
    for name, text in data.get("known", {}).items():
        if name not in fields:
            raise InputError(f"known.{name}", None, known=fields, where=where)
        known[name] = value(text, f"known.{name}", fields[name].unit)
    for i, entry in enumerate(data["constraint"], 1):
        place = f"constraint {i}"
        only(entry, {"what", "value", "pressure", "length"}, place)
        quantity = word(entry, "what", f"{place}.")
        if quantity not in KINDS:
            raise InputError(f"{place}.what", quantity, known=KINDS, where=where)
        number = value(entry.get("value", ""), f"{place}.value", KINDS[quantity])
        pressure = value(entry.get("pressure", ""), f"{place}.pressure", "Pa")
        length = None if entry.get("length") is None else value(entry["length"], f"{place}.length", "m")
        constraints.append(Constraint(quantity, number, pressure, length))
    return fit_constraints(law, constraints, known=known)


def _check(law: str, constraints: Sequence[Constraint], free: tuple[str, ...], known: Mapping[str, float]) -> None:
    for c in constraints:
        if c.what not in KINDS:
            raise InputError("constraint", c.what, known=KINDS)
        if c.what != "free_length" and c.length is None:
            raise InputError(f"constraint {c.what}", None, "needs the length at which it holds")
    if not constraints:
        raise InputError("constraints", None, "must be one or more")
    each_once("free", free)
    for name in required_fields(law_type(law)):
        if name not in free and name not in known:
            raise InputError(name, None, f"is missing: the law {law} needs it")
