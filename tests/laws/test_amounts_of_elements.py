"""What adds up over elements in parallel is stated of each: one number for several is refused, and shares keep the sum."""

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.muscles.elements import MaxwellChain
from mckibben.muscles.hysteresis import (
    HYSTERESES,
    BoucWen,
    Dahl,
    FrictionLimit,
    MaxwellSlip,
    PlayMap,
    PrandtlIshlinskii,
)
from mckibben.quantities import declared

WHOLE = FrictionLimit(constant=8.0, per_pressure=2e-5)
EACH = WHOLE.scaled(np.full(4, 0.25))
MANY = np.array([4e3, 2e3, 1e3, 5e2])

# Of each law with arrays what it is made of, and by which names one number would stand for all.
LAWS = {
    MaxwellSlip: ({"limit": EACH, "stiffness": MANY}, {"limit": WHOLE, "stiffness": 1e3}),
    Dahl: ({"limit": EACH, "stiffness": MANY}, {"limit": WHOLE, "stiffness": 1e3}),
    BoucWen: ({"limit": EACH, "stiffness": MANY}, {"limit": WHOLE, "stiffness": 1e3}),
    PrandtlIshlinskii: ({"weight": MANY, "threshold": 1e-3 * np.arange(1.0, 5.0)}, {"weight": 1e3}),
    PlayMap: ({"weight": 1e-8 * np.ones(4), "threshold": 1e4 * np.arange(4.0)}, {"weight": 1e-8}),
    MaxwellChain: ({"stiffness": MANY, "time_constant": np.array([0.1, 1.0, 10.0, 100.0])}, {"stiffness": 1e3}),
}
TRAPS = [(kind, name) for kind, (_, single) in LAWS.items() for name in single]


def test_every_friction_with_arrays_is_among_them():
    arrays = {kind for kind in HYSTERESES.values() if any("shape (" in q.doc for q in declared(kind).values())}
    assert arrays <= set(LAWS)


@pytest.mark.parametrize(("kind", "name"), TRAPS, ids=lambda one: getattr(one, "__name__", one))
def test_one_amount_beside_several_elements_is_refused(kind, name):
    parts, single = LAWS[kind]
    kind(**parts)  # each its own
    with pytest.raises(InputError, match=r"each of 4 elements.*share it"):
        kind(**{**parts, name: single[name]})


def test_a_limit_that_grows_with_pressure_is_shared_as_well():
    with pytest.raises(InputError, match="per_pressure"):
        MaxwellSlip(limit=FrictionLimit(constant=np.full(4, 2.0), per_pressure=2e-5), stiffness=MANY)


def test_other_numbers_of_elements_are_refused():
    with pytest.raises(InputError, match="3 and 4"):
        MaxwellSlip(limit=WHOLE.scaled(np.full(3, 1 / 3)), stiffness=MANY)


def test_shares_of_a_limit_keep_its_sum():
    shared = MaxwellSlip(limit=EACH, stiffness=MANY)
    assert float(shared.largest_force(5e5)) == pytest.approx(float(WHOLE.force(5e5)), rel=1e-12)  # rounding
    even = MaxwellSlip.geometric(WHOLE, elements=4)
    assert float(even.largest_force(5e5)) == pytest.approx(float(WHOLE.force(5e5)), rel=1e-12)
