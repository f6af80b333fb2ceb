"""Check of a law or friction of one's own: what is wrong with it, and whether it can be compiled to a kernel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import lanewise
from lanewise.errors import LanewiseError

from .._jax import Scalar, Tree
from ..components import Hysteresis
from ..errors import InputError
from ..muscles.check import LawFinding, declaration_findings, friction_findings, law_findings, sample
from ..muscles.law import TensionLaw, law_name
from ..muscles.laws import LAWS, law_key
from ..registry import is_reference, load_reference, named_by_person

DEMAND = "a tension law or a friction: a class derived from mckibben.TensionLaw or mckibben.components.Hysteresis"


def check(
    what: str | type[object] | TensionLaw | Hysteresis,
    parameters: Mapping[str, float] | None = None,
    *,
    lowest: float = 0.0,
) -> list[LawFinding]:
    """What is wrong with a tension law or a friction; empty where nothing is.

    Args:
        what: a law or friction with its parameters, its class, the name of a law, or a reference such as ``my.py:MyLaw``.
        parameters: parameters of a class by name [SI]; usual ones where left out.
        lowest: lowest gauge pressure at which cycles and volume of a law are judged [Pa].

    Returns:
        Findings on declarations, finite values, push, potential, derivatives, volume, closed cycles, passivity, lowering.

    Raises:
        InputError: there is no such file or class, it is neither law nor friction, or a parameter is unknown.

    Examples:
        >>> import mckibben as mk
        >>> mk.check("ideal")
        []
    """
    subject = what
    named_by_person(what)
    if isinstance(subject, str):
        subject = load_reference(subject, field="law") if is_reference(subject) else LAWS.find(subject)
    if isinstance(subject, type):
        if not issubclass(subject, TensionLaw | Hysteresis):
            raise InputError("law", str(what), f"must be {DEMAND}", sentence=f"{what} must be {DEMAND}")
        if isinstance(what, str) and issubclass(subject, TensionLaw):
            LAWS.find(what)  # complete, and from now on known by that name
        elif issubclass(subject, TensionLaw):
            law_key(subject)
        faults = declaration_findings(subject)
        try:
            subject = sample(subject, parameters)
        except InputError:
            if not faults:
                raise
            return faults
    if isinstance(subject, TensionLaw):
        return law_findings(subject, lowest=lowest) + _lowering(_tension_and_volume, subject, 0.2, 3e5)
    if isinstance(subject, Hysteresis):
        return friction_findings(subject) + _lowering(_advance, subject, 1e-3, 3e5)
    raise InputError("law", str(what), f"must be {DEMAND}", sentence=f"{what} must be {DEMAND}")


def _tension_and_volume(law: TensionLaw, length: Scalar, pressure: Scalar) -> tuple[Tree, Tree]:
    return law.braid_tension(length, pressure), law.braid_volume(length, pressure)


def _advance(friction: Hysteresis, displacement: Scalar, pressure: Scalar) -> tuple[Tree, Tree]:
    out = friction.advance(
        friction.initial(), displacement, start_pressure=pressure, end_pressure=pressure, duration=1e-3
    )
    return out, friction.force(out.state, displacement, pressure)


def _lowering(function: Any, subject: Any, *examples: float) -> list[LawFinding]:
    try:
        lanewise.lower(function, subject, *examples)
    except LanewiseError as error:
        return [
            LawFinding(
                "lowering", f"{law_name(subject)}: cannot be compiled to a kernel: {' '.join(str(error).split())}"
            )
        ]
    except Exception as error:  # whatever the code of a user raises while it is traced; `law_findings` has said what
        lines = str(error).strip().splitlines() or [""]
        said = f"cannot be compiled to a kernel: {type(error).__name__}: {lines[0][:150]}"
        return [LawFinding("lowering", f"{law_name(subject)}: {said}")]
    return []
