"""Every law with parameters that a muscle could have, and one compiled function for all tests of a kind.

`examples` are fixed, the shipped specimens among them; `muscle_like` makes a law of a vector of numbers in [0, 1], whose
parameters fit each other (a wall thinner than the braid, a working range that holds gas).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence

from mckibben.muscles.build import build_law, law_from_specimen
from mckibben.muscles.law import TensionLaw
from mckibben.muscles.laws import LAWS
from mckibben.specimens import specimen

# They solve an equilibrium in their law, which takes half a minute of compilation for some of the tests.
SEATED = ("seated_braid", "seated_hyperelastic_braid")

# How many numbers in [0, 1] make a law.
DRAWS = 12

_STATED = {
    "gas_spring": dict(stiffness_per_pressure=4.66e-3, shortest_length=0.0991, rest_length=0.14, upper_length=0.154),
    "tondu_lopez": dict(rest_length=0.3, rest_radius=0.01, rest_angle=0.45, end_factor=1.2, upper_length=0.3),
    "hyperelastic_braid": dict(
        rest_length=0.3, rest_diameter=0.02, wall_thickness=1.8e-3, thread_depth=0.6, rest_angle=0.48,
        shear_modulus=1.3e6, thread_compliance=8e-9, upper_length=0.3,
    ),
    "seated_braid": dict(
        rest_length=0.182, rest_diameter=0.01, wall_thickness=1.8e-3, rest_angle=0.42, shear_modulus=1.1e6,
        seat_compliance=1.2e-4, upper_length=0.182,
    ),
    "seated_hyperelastic_braid": dict(
        rest_length=0.25, rest_diameter=0.01, wall_thickness=1.8e-3, thread_depth=0.8, rest_angle=0.45,
        shear_modulus=2e6, ogden_exponent=-4.5, thread_compliance=3e-9, inactive_share=0.3, seat_compliance=9e-5,
        upper_length=0.25,
    ),
    "sarosi": dict(
        rest_length=0.3, upper_length=0.3, area_exponential=4e-5, force_exponential=220.0, decay=-33.0,
        area_slope=-6.7e-3, area_constant=1.8e-3, force_constant=-150.0,
    ),
    "three_element": dict(
        rest_length=0.3, upper_length=0.3, force_constant=10.0, force_per_pressure=1.6e-3, stiffness_constant=900.0,
        stiffness_per_pressure=0.02,
    ),
}  # fmt: skip


@functools.cache
def examples() -> dict[str, TensionLaw]:
    """Fixed laws by a name of their own: each law at least once, each specimen's law, and the variants of structure."""
    found = {}
    for muscle in ("nylon", "fiberglass", "bridgestone", "DMSP-10-250", "DMSP-20-300", "Festo-10mm"):
        spec = specimen(muscle)
        found |= {f"{law} {muscle}": law_from_specimen(spec, law) for law in spec.laws}
    found |= {law: build_law(law, parameters) for law, parameters in _STATED.items()}
    found["tondu_lopez k(P)"] = found["tondu_lopez"].replace(end_factor_gain=0.2)
    found["tondu_lopez published k(P)"] = found["tondu_lopez"].replace(end_factor=1.25, end_factor_gain=3.55)
    found["hyperelastic_braid stiff threads"] = found["hyperelastic_braid"].replace(thread_compliance=0.0)
    found["sarosi with volume"] = build_law("sarosi", _STATED["sarosi"] | {"rest_volume": 1.2e-4})
    found["three_element with volume"] = build_law("three_element", _STATED["three_element"] | {"rest_volume": 1.2e-4})
    # No muscle states all end effects at once, so one example does.
    found["linear_threshold blunt"] = found["linear_threshold nylon"].replace(threshold_width=3e5, stop_stiffness=1e6)
    found["thick_wall stop"] = found["thick_wall nylon"].replace(stop_stiffness=3e7, threshold_width=1e5)
    return found


def example(law: str) -> TensionLaw:
    """The example that is stated above where there is one, whose numbers no fit changes, else the first of a specimen."""
    return examples().get(law) or next(value for name, value in examples().items() if name.split()[0] == law)


def muscle_like(law: str, draw: Sequence[float]) -> TensionLaw:
    """A law whose parameters fit each other, from `DRAWS` numbers in [0, 1]."""
    return build_law(law, _MUSCLE_LIKE[law](_Draw(draw)))


class _Draw:
    """Hands out one number after the other, each brought into a range."""

    def __init__(self, numbers: Sequence[float]) -> None:
        self.numbers = iter(numbers)

    def flat(self, low: float, high: float) -> float:
        return low + (high - low) * next(self.numbers)

    def log(self, low: float, high: float) -> float:
        return low * (high / low) ** next(self.numbers)


def _ideal(d: _Draw) -> dict[str, float]:
    return dict(thread_length=d.log(0.05, 1.0), turns=d.log(0.8, 8.0), threshold_width=d.log(1e3, 1e5))


def _thick_wall(d: _Draw) -> dict[str, float]:
    shape = _ideal(d)
    narrow = shape["thread_length"] / (math.pi * shape["turns"]) * math.sqrt(1.0 - 0.95**2)
    return shape | dict(
        wall_thickness=d.flat(0.01, 0.25) * narrow,
        upper_length=d.flat(0.7, 0.95) * shape["thread_length"],
        stop_stiffness=d.log(1e4, 1e8),
    )


def _gas_spring(d: _Draw) -> dict[str, float]:
    rest, per_pressure = d.log(0.05, 0.5), d.log(5e-4, 5e-2)
    shortest, upper = d.flat(0.5, 0.85) * rest, d.flat(1.0, 1.15) * rest
    drop = 0.5 * per_pressure * ((upper - shortest) ** 2 - (rest - shortest) ** 2)
    return dict(
        stiffness_per_pressure=per_pressure, shortest_length=shortest, rest_length=rest, upper_length=upper,
        rest_volume=d.flat(1.2, 3.0) * max(drop, 0.02 * per_pressure * rest**2), threshold_width=d.log(1e3, 1e5),
    )  # fmt: skip


def _linear_threshold(d: _Draw) -> dict[str, float]:
    return _gas_spring(d) | dict(
        threshold_pressure=d.flat(0.0, 2e5), passive_stiffness=d.log(1e1, 1e4), stop_stiffness=d.log(1e4, 1e8)
    )


def _tondu_lopez(d: _Draw) -> dict[str, float]:
    rest, angle = d.log(0.05, 0.5), d.flat(0.3, 0.75)
    return dict(
        rest_length=rest, rest_radius=rest * d.log(0.02, 0.08), rest_angle=angle, end_factor=d.flat(0.8, 1.6),
        end_factor_gain=d.flat(-0.2, 1.0), end_factor_pressure=d.log(1e5, 3e5), threshold_width=d.log(1e3, 1e5),
        # Less than halfway to the thread length, where the braid holds no gas.
        upper_length=rest * (1.0 + d.flat(0.0, 0.4) * (1.0 / math.cos(angle) - 1.0)),
    )  # fmt: skip


def _martens_boblan(d: _Draw) -> dict[str, float]:
    # Four free coefficients of a cubic make no muscle; the two published ones are scaled and bent instead.
    base = {k: float(v) for k, v in vars(example("martens_boblan")).items()}
    size, stiff = d.log(0.3, 3.0), d.flat(0.7, 1.3)
    lengths = {k: base[k] * size for k in ("rest_length", "rest_diameter", "wall_thickness")}
    moduli = {f"modulus_{i}": stiff * base[f"modulus_{i}"] / size**i for i in range(4)}
    angle = base["angle_correction"] + d.flat(-0.03, 0.03)
    return (
        lengths | moduli | dict(rest_angle=base["rest_angle"], angle_correction=angle, threshold_width=d.log(1e3, 1e5))
    )


def _braid(d: _Draw) -> dict[str, float]:
    rest = d.log(0.08, 0.5)
    wide = min(rest * d.log(0.03, 0.12), 0.04)
    return dict(
        rest_length=rest, rest_diameter=wide, wall_thickness=wide * d.flat(0.05, 0.25),
        upper_length=rest * d.flat(1.0, 1.03),
        shear_modulus=d.log(4e5, 5e6), rest_angle=d.flat(0.38, 0.6), threshold_width=d.log(1e3, 1e5),
    )  # fmt: skip


def _hyperelastic_braid(d: _Draw) -> dict[str, float]:
    return _braid(d) | dict(
        thread_depth=d.flat(0.0, 1.0), length_factor=d.flat(0.99, 1.01), thread_compliance=d.flat(0.0, 2e-8),
        inactive_share=d.flat(0.0, 1.0),
    )  # fmt: skip


def _seated_braid(d: _Draw) -> dict[str, float]:
    return _braid(d) | dict(seat_compliance=d.log(3e-5, 4e-4))


def _seated_hyperelastic_braid(d: _Draw) -> dict[str, float]:
    return _braid(d) | dict(
        # Threads that strain by 1e-300 would put rounding of the same order where a slack muscle has exact zeros.
        seat_compliance=d.log(3e-5, 4e-4), thread_depth=d.flat(0.0, 1.0), thread_compliance=d.flat(1e-12, 2e-8),
        inactive_share=d.flat(0.0, 0.8), ogden_exponent=d.flat(-8.0, 3.0),
    )  # fmt: skip


def _sarosi(d: _Draw) -> dict[str, float]:
    rest, constant = d.log(0.05, 0.5), d.flat(10.0, 500.0)
    return dict(
        # The exponential keeps its sign up to 10 bar, so that tension grows with length.
        rest_length=rest, upper_length=rest, force_exponential=constant, area_exponential=d.flat(-1e-6, 1e-6) * constant,
        decay=d.flat(-60.0, -5.0), area_slope=d.flat(-1e-2, -1e-4), area_constant=d.flat(5e-4, 5e-3),
        force_constant=d.flat(-150.0, 100.0),
    )  # fmt: skip


def _three_element(d: _Draw) -> dict[str, float]:
    rest = d.log(0.05, 0.5)
    return dict(
        rest_length=rest, upper_length=rest, force_constant=d.flat(-50.0, 200.0), force_per_pressure=d.log(5e-4, 5e-3),
        stiffness_constant=d.flat(1e2, 1e4), stiffness_per_pressure=d.log(1e-3, 5e-2),
    )  # fmt: skip


_MUSCLE_LIKE: dict[str, Callable[[_Draw], dict[str, float]]] = {
    "ideal": _ideal,
    "thick_wall": _thick_wall,
    "gas_spring": _gas_spring,
    "linear_threshold": _linear_threshold,
    "tondu_lopez": _tondu_lopez,
    "martens_boblan": _martens_boblan,
    "hyperelastic_braid": _hyperelastic_braid,
    "seated_braid": _seated_braid,
    "seated_hyperelastic_braid": _seated_hyperelastic_braid,
    "sarosi": _sarosi,
    "three_element": _three_element,
}
SHIPPED = tuple(name for name, kind in LAWS.items() if kind.__module__.startswith("mckibben."))  # others are of tests
assert set(_MUSCLE_LIKE) == set(SHIPPED), "a new law needs random parameters here"
