"""Sizes of a muscle that contradict each other, named where a simulation could not go on."""

from __future__ import annotations

import contextlib

from ..errors import InputError, NoVolumeError
from ..quantities import declared, with_unit
from .law import TensionLaw, law_name

FACTORS = [1.025**n for step in range(1, 66) for n in (step, -step)]  # of a size that are tried: from near 1 to 5


def volume_contradiction(law: TensionLaw, span: float) -> InputError | None:
    """Error about sizes that contradict each other, so that a law has no gas volume above zero; None where it has one.

    The size named is the one that has to be changed least.

    Args:
        law: the law.
        span: at which the muscle is mounted [m].
    """
    try:
        volume = float(law.volume(span, 0.0))
    except NoVolumeError:
        return None
    if volume > 0.0:
        return None
    key, of = law_name(law), with_unit(volume, "m^3", 3)
    said = f"the muscle's volume of gas would be {of} at a span of {with_unit(span, 'm', 4)}: the sizes in {key}"
    sizes = {n: float(getattr(law, n)) for n, q in declared(type(law)).items() if q.unit in ("m", "m^3")}
    for factor in FACTORS:
        for name, size in sizes.items():
            if _has_volume(law, name, factor * size, span):
                unit = declared(type(law))[name].unit
                stated, possible = with_unit(size, unit, 3), with_unit(factor * size, unit, 3)
                what = f"{said} contradict each other. {name} is {stated}; {possible} would do"
                return InputError(f"{key}.{name}", None, f"contradicts the other sizes of {key}", sentence=what)
    return InputError(key, None, "contradicts itself", sentence=f"{said} contradict each other")


def _has_volume(law: TensionLaw, name: str, size: float, span: float) -> bool:
    """Whether a law has a volume above zero at a span with another value of a size."""
    with contextlib.suppress(InputError):
        return float(law.replace(**{name: size}).volume(span, 0.0)) > 0.0
    return False
