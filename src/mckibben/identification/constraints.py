"""Parameters from printed numbers instead of a table: "323 N per rest length at 5 bar, free at 0.75 L0".

A paper rarely prints enough of them. What the constraints leave open is said in words and in infinite intervals, and the
solution then follows from the starting values, which is a choice and no finding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, jax, jnp
from ..errors import ConvergenceError, InputError
from ..estimation import Estimate, Estimation, Parameter, determined, open_groups
from ..muscles.build import construct, required_fields
from ..muscles.law import TensionLaw
from ..muscles.laws import law_type
from ..quantities import declared

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


class ConstrainedFit(NamedTuple):
    """Parameters that meet the constraints; an interval is infinite where the constraints leave the parameter open."""

    law: str
    parameters: dict[str, Estimate]
    known: dict[str, float]
    warnings: tuple[str, ...]

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
    estimates = {}
    for (name, p), x in zip(parameters.items(), at, strict=True):
        meets = float(p.value(x))
        ends = (-np.inf, np.inf) if name in open_ else (meets, meets)
        estimates[name] = Estimate(meets, *ends, p.unit)
    warnings = (
        f"{len(directions)} independent constraints of {len(constraints)} leave {len(free) - len(directions)} of "
        f"{len(free)} parameters open: they cannot tell {', '.join(open_)} apart",
        "the values given follow from the starting values; they are a choice and no finding",
    )
    return ConstrainedFit(law, estimates, dict(known), warnings if open_ else ())


def _check(law: str, constraints: Sequence[Constraint], free: tuple[str, ...], known: Mapping[str, float]) -> None:
    for c in constraints:
        if c.what not in KINDS:
            raise InputError("constraint", c.what, known=KINDS)
        if c.what != "free_length" and c.length is None:
            raise InputError(f"constraint {c.what}", None, "needs the length at which it holds")
    if not constraints:
        raise InputError("constraints", None, "must be one or more")
    for name in required_fields(law_type(law)):
        if name not in free and name not in known:
            raise InputError(name, None, f"is missing: the law {law} needs it")
