"""Parameters of a law that contradict each other, named where a simulation could not go on."""

from __future__ import annotations

import contextlib

from ..errors import InputError, NoVolumeError
from ..quantities import declared, with_unit
from .braid import braid_of
from .law import TensionLaw, law_name

FACTORS = [1.025**n for step in range(1, 66) for n in (step, -step)]  # of a value that are tried: from near 1 to 5


def check_geometry(law: TensionLaw, rest_length: float) -> None:
    """Refuse a muscle that cannot be: a wall that fills its braid at rest, or parameters that leave no gas in it.

    Raises:
        InputError: names the parameter, and values that would do.
    """
    shape, wall = braid_of(law), getattr(law, "wall_thickness", None)
    # where the law states a bore, the wall lies around it
    if shape is not None and wall is not None and not hasattr(law, "rest_diameter"):
        bore = shape.diameter(rest_length)
        if 2.0 * float(wall) >= bore:
            at = f"{with_unit(bore, 'm', 3)} wide at {with_unit(rest_length, 'm', 3)}"
            problem = f"must be less than {with_unit(0.5 * bore, 'm', 3)}, or it fills the braid, which is {at}"
            raise InputError(f"{law_name(law)}.wall_thickness", with_unit(float(wall), "m", 3), problem)
    error = volume_contradiction(law, rest_length)
    if error is not None:
        raise error


def volume_contradiction(law: TensionLaw, span: float) -> InputError | None:
    """Error about parameters that contradict each other, so that a law has no gas volume above zero; None where it has.

    The parameters that could be changed are named, each alone, that first which has to be changed least.

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
    said = f"the muscle's volume of gas would be {of} at a span of {with_unit(span, 'm', 4)}"
    units = {n: q.unit for n, q in declared(type(law)).items()}
    values = {n: float(getattr(law, n)) for n in units}
    remedies: dict[str, str] = {}
    for factor in FACTORS:
        for name, value in values.items():
            if name not in remedies and _has_volume(law, name, factor * value, span):
                possible, stated = with_unit(factor * value, units[name], 3), with_unit(value, units[name], 3)
                remedies[name] = f"{name} {possible} (not {stated})"
    field = f"{key}.{next(iter(remedies))}" if remedies else key
    what = f"{said}: the parameters of {key} contradict each other"
    sentence = f"{what}. What would do: {' or '.join(remedies.values())}" if remedies else what
    return InputError(field, None, f"contradicts the other parameters of {key}", sentence=sentence)


def _has_volume(law: TensionLaw, name: str, value: float, span: float) -> bool:
    """Whether a law has a volume above zero at a span with another value of a parameter."""
    with contextlib.suppress(InputError):
        return float(law.replace(**{name: value}).volume(span, 0.0)) > 0.0
    return False
