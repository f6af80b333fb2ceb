"""What a working cycle is run between where nobody says more: the muscle's own lengths, friction and surroundings.

The command line and the screen both ask here, so that the same words give the same cycle.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np

from ...components import Environment
from ...errors import InputError
from ...muscles.build import law_from_specimen
from ...quantities import Quantity, with_unit
from ...specimens import Specimen
from .cycles import Conditions
from .volumes import VOLUMES, CycleMuscle, cycle_muscle, has_paper_volume

# What a person may set, each declared once; the muscle says more closely what is allowed.
SETTINGS = {
    "pressure": Quantity("Pa", (0.0, 1e8), "gauge pressure of the supply", "P", (1e5, 10e5)),
    "accumulator_pressure": Quantity("Pa", (-1e5, 1e8), "gauge pressure of the accumulator", "Px", (0.0, 5e5)),
    "friction": Quantity("N", (0.0, 1e3), "Coulomb friction while shortening", "Fc", (0.0, 50.0)),
    "stretched_length": Quantity("m", (0.0, 10.0), "length at which each cycle begins", "L2", (0.01, 1.0)),
}


def cycle_muscles(
    spec: Specimen, law: str = "", volume: str = "", changes: Mapping[str, float] | None = None
) -> tuple[str, dict[str, CycleMuscle]]:
    """The name of a specimen's law, and its muscle with each volume that it has; the one that is asked for is the first.

    Args:
        spec: of a McKibben muscle.
        law: where the specimen states several.
        volume: of `VOLUMES`; the paper's where the law has it, if left out.
        changes: parameters of the law that are replaced [SI].
    """
    if spec.kind != "mckibben":
        raise InputError("specimen", spec.id, f"its kind is {spec.kind}; allowed is a McKibben muscle")
    chosen = law or spec.law
    built = law_from_specimen(spec, chosen, changes=dict(changes or {}))
    which = volume or ("paper" if has_paper_volume(built) else "potential")
    order = [which, *(v for v in VOLUMES if v != which and (v == "potential" or has_paper_volume(built)))]
    return chosen, {v: cycle_muscle(built, v) for v in order}


def surroundings(spec: Specimen) -> Environment:
    """Those of the papers for the muscles of the papers, else the standard's."""
    return _of_the_papers() if "chou1996" in spec.sources else Environment()


@functools.cache
def _of_the_papers() -> Environment:
    return Environment.of_the_papers()


def stretched_length(spec: Specimen, muscle: CycleMuscle) -> float:
    """Where cycles begin [m]."""
    known = [n for n in ("stretched_length", "upper_length", "rest_length") if n in spec.properties]
    return spec.property_si(known[0], "m") if known else float(muscle.length_range()[1])


def check_threads(spec: Specimen, length: float, *, field: str = "stretched_length", shown: str = "") -> None:
    """Refuse a length [m] that is not below that of the threads, wherever the specimen states one."""
    for group in spec.laws.values():
        if "thread_length" in group:
            threads = group["thread_length"].si("m", field="thread_length", where=spec.where)
            if isinstance(threads, float) and length >= threads:
                raise InputError(
                    field, shown or with_unit(length, "m"),
                    f"allowed is below {with_unit(threads, 'm')}, the length of its threads",
                )  # fmt: skip


def coulomb_friction(spec: Specimen) -> float:
    """As the specimen states it, zero where it does not [N]."""
    return spec.property_si("coulomb_friction", "N") if "coulomb_friction" in spec.properties else 0.0


def at_threshold(
    muscle: CycleMuscle, law: str, *, field: str = "accumulator", cure: str = "a pressure of its own"
) -> float:
    """Gauge pressure of an accumulator at the threshold [Pa].

    Raises:
        InputError: the law has no threshold; `cure` is what is allowed instead.
    """
    if float(muscle.threshold()) <= 0.0:
        raise InputError(field, "given", f"the law '{law}' has no threshold pressure; allowed is {cure}")
    return float(muscle.threshold())


def pressures(muscle: CycleMuscle, conditions: Conditions, highest: float, points: int) -> np.ndarray:
    """Gauge pressures for a curve, from where cycles begin to be possible up to the highest (points,) [Pa]."""
    low = max(float(muscle.threshold()), conditions.exchange_pressure, 0.0)
    return np.asarray(low + (highest - low) * np.linspace(0.0, 1.0, points + 1)[1:])
