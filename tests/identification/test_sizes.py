"""Fits to muscles of any size: what a law itself has made gives its parameters back."""

import numpy as np
import pytest

import mckibben as mk
from law_examples import example
from mckibben.errors import InputError
from mckibben.identification.problem import _power_of_length
from mckibben.muscles.build import build_law
from mckibben.muscles.laws import LAWS, law_type
from mckibben.quantities import declared
from mckibben.recordings import ForceMap

FITTED = [name for name in LAWS if law_type(name).fitted]
# Eight parameters of 28 points trade against each other: the tension is met to this share of the largest, no parameter is.
LOOSE = {"seated_hyperelastic_braid": 1e-3}


def similar(name: str, size: float):
    """The example of a law, each dimension larger by the power of length in its unit: a muscle similar to it."""
    law = example(name)
    changes = {
        key: float(getattr(law, key)) * size ** _power_of_length(q.unit) for key, q in declared(type(law)).items()
    }
    return law.replace(**changes)


def measured(law, lengths) -> ForceMap:
    at, pressure = (x.ravel() for x in np.meshgrid(lengths, [2e5, 3e5, 4e5, 5e5]))
    return ForceMap(
        "made", at, pressure, np.array([float(law.tension(x, p)) for x, p in zip(at, pressure, strict=True)])
    )


@pytest.mark.parametrize("longest", [0.01, 5.0])
@pytest.mark.parametrize("name", FITTED)
def test_a_law_is_recovered_at_any_size(name, longest):
    """From 1 cm to 5 m. The solver stops at 1e-8 of the parameters; rounding of the tension leaves less."""
    size = longest / float(example(name).length_range()[1])
    law = similar(name, size)
    points = measured(law, np.linspace(0.85, 0.98, 7) * longest)
    # a rest volume that is stated is one that is known, which it is not here
    known = {k: float(getattr(law, k)) for k in declared(type(law)) if k not in (*law.fitted, "rest_volume")}
    fit = mk.fit(points, [name], known=known).fits[0]
    assert float(np.sqrt(np.mean(np.square(fit.error)))) <= LOOSE.get(name, 1e-9) * points.tension.max()
    if name not in LOOSE:
        for key, one in fit.parameters.items():
            assert one.value == pytest.approx(float(getattr(law, key)), rel=1e-6, abs=1e-9), key


@pytest.mark.parametrize("longest", [0.8, 2.0, 5.0])
def test_a_long_muscle_of_a_usual_diameter_is_fitted_by_the_ideal_law(longest):
    """Threads of 1.19 times the longest length, in turns of a braid of 2.16 cm: 14 turns and more."""
    thread = longest / 0.842
    law = build_law("ideal", {"thread_length": thread, "turns": thread / (np.pi * 0.0216)})
    fit = mk.fit(measured(law, np.linspace(0.78, 1.0, 5) * longest), ["ideal"]).fits[0]
    assert fit.parameters["thread_length"].value == pytest.approx(thread, rel=1e-6)
    assert fit.parameters["turns"].value == pytest.approx(float(law.turns), rel=1e-6)


@pytest.mark.parametrize(
    ("unit", "power"), [("N", 2), ("N/m", 1), ("Pa/m^2", -2), ("m/N^0.5", 0), ("rad", 0), ("1/Pa", 0)]
)
def test_the_power_of_length_in_a_unit(unit, power):
    assert _power_of_length(unit) == power


def test_a_fit_with_every_parameter_stated_says_so():
    law = build_law("ideal", {"thread_length": 0.16, "turns": 3.0})
    with pytest.raises(
        InputError, match="thread_length, turns of the law ideal are all stated, so there is nothing to fit"
    ):
        mk.fit(measured(law, np.linspace(0.12, 0.14, 4)), ["ideal"], known={"thread_length": 0.16, "turns": 3.0})
