"""A friction with one fault is found out by that fault, and no other is said of it."""

import re
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import mckibben as mk
from mckibben.muscles import check
from mckibben.muscles.hysteresis import Dahl, FrictionLimit


class Weak(Dahl):
    """Its force is beyond what it says is its largest."""

    def largest_force(self, pressure):
        return 0.5 * Dahl.largest_force(self, pressure)


class Loses(Dahl):
    """A tenth of its heat is told to nobody."""

    def advance(self, *place, **times):
        out = Dahl.advance(self, *place, **times)
        return out._replace(dissipated=0.9 * out.dissipated)


class Cools(Dahl):
    """It takes its heat from around, and work and energy balance with that."""

    def advance(self, *place, **times):
        out = Dahl.advance(self, *place, **times)
        return out._replace(work=out.work - 2.0 * out.dissipated, dissipated=-out.dissipated)


class Endless(Dahl):
    """Its energy is no number."""

    def stored_energy(self, state):
        return jnp.nan * Dahl.stored_energy(self, state)


class Raises(Dahl):
    """It cannot be advanced."""

    def force(self, state, velocity, pressure):
        raise ValueError("no force\nat all")


FAULTS = {
    Dahl: None,
    Weak: ("limit", r": its force of [\d.]+ N is beyond its largest force of [\d.]+ N, at [\d.]+ bar"),
    Loses: (
        "balance",
        r": loses [\d.e-]+ J between work, heat and stored energy, displaced by .* mm at [\d.]+ bar",
    ),
    Cools: ("passivity", r": takes [\d.e-]+ J from heat in one step, displaced by .* mm at [\d.]+ bar"),
    Endless: ("finite", r": its force or energy is not finite along a path"),
    Raises: ("error", r": cannot be advanced: ValueError: no force$"),
}


@pytest.mark.parametrize("kind", FAULTS, ids=lambda kind: kind.__name__)
def test_a_friction_with_one_fault_has_one_finding(kind: Any) -> None:
    found = check.friction_findings(kind(limit=FrictionLimit(constant=2.0, per_pressure=4e-6), stiffness=2e4))
    if FAULTS[kind] is None:
        assert found == []
        return
    (one,) = found
    assert one.kind == FAULTS[kind][0] and re.search(FAULTS[kind][1], one.sentence), one
    if kind is Weak:  # by how much, of two numbers with four digits
        force, most = map(float, re.findall(r"([\d.]+) N", one.sentence))
        assert most < force and one.value == pytest.approx(force - most, abs=2e-3)


def declared(unit="N", bounds=(0.0, 10.0), doc="a force", typical=(1.0, 2.0), fitted=()):
    """Findings about a law with one parameter."""

    class Law(mk.TensionLaw):
        gain = mk.quantity(unit, bounds, doc, typical=typical)

    Law.fitted = fitted
    return [one.sentence for one in check.declaration_findings(Law)]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, None),
        ({"fitted": ("gain",)}, None),
        ({"typical": (0.0, 10.0)}, None),
        ({"fitted": ("gian",)}, "fitted names 'gian', which is no parameter"),
        ({"unit": "furlong^^2"}, "'furlong^^2' of gain is no unit"),
        (
            {"bounds": (10.0, 10.0), "typical": (10.0, 10.0)},
            "the bounds of gain must be two numbers, the smaller first: they are 10 to 10",
        ),
        ({"bounds": (0.0, np.inf)}, "the bounds of gain must be two numbers, the smaller first: they are 0 to inf"),
        ({"bounds": (-np.inf, 9.0)}, "the bounds of gain must be two numbers, the smaller first: they are -inf to 9"),
        ({"typical": (2.0, 1.0)}, "the usual range of gain, 2 to 1, is not within its bounds"),
        ({"typical": (-1.0, 1.0)}, "the usual range of gain, -1 to 1, is not within its bounds"),
        ({"typical": (1.0, 11.0)}, "the usual range of gain, 1 to 11, is not within its bounds"),
        ({"doc": " "}, "gain has no meaning stated"),
    ],
)
def test_a_declaration_with_one_fault_has_one_finding(changes: dict[str, Any], says: str | None) -> None:
    found = declared(**changes)
    assert len(found) == (says is not None) and all(one.endswith(says or "") for one in found), found


def test_a_rule_of_lobatto_is_exact_up_to_its_degree_and_has_a_node_at_both_ends():
    """n nodes integrate powers to 2n - 3 exactly, and not the next one; 1e-14 is rounding of a handful of terms."""
    for count in (2, 3, 5):
        nodes, weights = check.lobatto(count)
        assert (nodes[0], nodes[-1]) == (0.0, 1.0) and len(nodes) == count
        errors = [abs(weights @ nodes**k - 1.0 / (k + 1)) for k in range(2 * count - 1)]
        assert max(errors[:-1]) < 1e-14 and errors[-1] > 1e-5


def test_pressures_that_are_tried_hold_zero_the_threshold_its_ends_and_both_ends_of_the_range():
    law = SimpleNamespace(threshold_pressure=5e4, threshold_width=2e4)
    tried = check.pressures(law, 40, lowest=-1e4, highest=3e5)
    assert len(tried) == 40 and (tried[0], tried[-1]) == (-1e4, 3e5) and np.all(np.diff(tried) >= 0.0)
    assert {0.0, 4e4, 5e4, 6e4} <= set(tried.tolist())
    assert {-5e3, 0.0, 5e3} <= set(check.pressures(SimpleNamespace()).tolist())  # as if one lay at zero, 0.1 bar wide


def test_a_step_along_a_path_lasts_a_millisecond_unless_another_time_is_stated():
    """A damper's force is its constant times the speed, so that it tells the time; exact but for rounding."""

    class Damper(Dahl):
        def force(self, state, velocity, pressure):
            return 3.0 * velocity

    damper = Damper(limit=FrictionLimit(constant=2.0, per_pressure=4e-6), stiffness=2e4)
    for times, speed in (((), 2e-2), ((1e-2,), 2e-3)):
        path = check.follow(damper, np.array([2e-5]), np.zeros(2), *times)
        assert float(path.before[0]) == float(path.after[0]) == pytest.approx(3.0 * speed, rel=1e-12)
