"""The frictions that a loop of pressure and stroke can identify, and what of them is fitted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from ..components import Hysteresis
from ..muscles.hysteresis import BoucWen, Dahl, FrictionLimit, MaxwellSlip


class Free(NamedTuple):
    """A parameter to fit: start, bounds and unit [unit]; it is searched in its logarithm where `log`."""

    start: float
    low: float
    high: float
    unit: str
    log: bool = False


_LIMIT = {
    "constant": Free(10.0, 1e-6, 1e3, "N"),
    "per_pressure": Free(1e-5, 0.0, 1e-3, "m^2"),
}
TRAVEL = {"shortest": Free(5e-4, 1e-6, 5e-2, "m", log=True), "spread": Free(10.0, 1.0, 1e3, "1", log=True)}
_STIFFNESS = {"stiffness": Free(1e4, 1e2, 1e7, "N/m", log=True)}


def _maxwell_slip(p: Mapping[str, Any]) -> Hysteresis:
    limit = FrictionLimit(constant=p["constant"], per_pressure=p["per_pressure"])
    return MaxwellSlip.geometric(limit, elements=6, shortest=p["shortest"], longest=p["shortest"] * p["spread"])


def _dahl(p: Mapping[str, Any]) -> Hysteresis:
    limit = FrictionLimit(constant=p["constant"], per_pressure=p["per_pressure"])
    return Dahl(limit=limit, stiffness=p["stiffness"])


def _bouc_wen(p: Mapping[str, Any]) -> Hysteresis:
    limit = FrictionLimit(constant=p["constant"], per_pressure=p["per_pressure"])
    return BoucWen(limit=limit, stiffness=p["stiffness"], share=p["share"])


# Frictions that a loop can identify. Coulomb's knows no force at rest and leaves the solved balance without a slope.
MODELS: dict[str, tuple[Callable[[Mapping[str, Any]], Hysteresis], dict[str, Free]]] = {
    "maxwell_slip": (_maxwell_slip, {**_LIMIT, **TRAVEL}),
    "dahl": (_dahl, {**_LIMIT, **_STIFFNESS}),
    "bouc_wen": (_bouc_wen, {**_LIMIT, **_STIFFNESS, "share": Free(0.6, 0.5, 20.0, "1")}),
}
# Without kinks, so that a descent finds the lowest minimum.
SMOOTH = ("dahl", "bouc_wen")
