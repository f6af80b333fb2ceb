"""No closed cycle of length and pressure yields work, however it runs through the threshold and through slack.

With F = dPsi/dL and V = -dPsi/dP' the work on the load less the work of the gas is the integral of F dL - V dP', which
must vanish around every closed polygon. The integrals are taken by Gauss-Lobatto on pieces of each edge: cut where the
rounding of the threshold begins and ends, then halved wherever the two halves disagree with the whole. That closes in on
every kink by itself, whether between taut and slack, at an end of the free length, or one that nobody listed.
"""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from law_examples import DRAWS, SEATED, SHIPPED, examples, muscle_like
from mckibben.muscles.check import evaluate, polygon, snaps, threshold_levels, unilateral, works
from mckibben.muscles.law import TensionLaw, law_name

SLOW = pytest.mark.slow  # half a minute of compilation; that its tension and volume share a potential is not slow
# Laws that only interpolate between the pressures of their fit; under vacuum their contraction terms change sign.
EMPIRICAL = ("sarosi", "three_element")


def assert_no_work(
    law: TensionLaw, seed: int, longest: float = 0.99, *, require: Callable[[bool], object] | None = None
) -> None:
    """`require` says what happens to a cycle that does not work at all: an example fails, a random law is drawn anew."""
    load, gas, exchanged, moved = works(
        unilateral(law), polygon(law, seed, longest, vacuum=vacuum(law)), threshold_levels(law)
    )
    worked = exchanged > 1e-3 * moved > 0.0
    if require is not None:
        require(worked)
    assert worked
    # The limit that the project promises. The quadrature itself closes to about 1e-11.
    assert abs(load - gas) <= 1e-8 * exchanged, (load - gas) / exchanged


def vacuum(law: TensionLaw) -> float:
    """Lowest pressure of a law's cycles [Pa]."""
    return 0.0 if law_name(law) in EMPIRICAL else -0.9e5


def one_equilibrium(law: TensionLaw) -> bool:
    """Whether an unloaded muscle has one place to be at each pressure, so that V is a function of span and pressure."""
    return snaps(law, lowest=vacuum(law)) is None


@pytest.mark.parametrize("name", [pytest.param(n, marks=SLOW) if n.startswith("seated") else n for n in examples()])
def test_closed_cycles_yield_no_work(name: str) -> None:
    law = examples()[name]
    assert one_equilibrium(law)
    for seed in range(2 if name.startswith(SEATED) else 6):
        assert_no_work(law, seed)


@pytest.mark.parametrize("law", [pytest.param(n, marks=SLOW) if n in SEATED else n for n in SHIPPED])
def test_closed_cycles_yield_no_work_for_random_parameters(law: str) -> None:
    @settings(max_examples=3 if law in SEATED else 15, deadline=None, database=None, derandomize=True)
    @given(st.lists(st.floats(0.0, 1.0), min_size=DRAWS, max_size=DRAWS), st.integers(0, 2**31))
    def check(draw: list[float], seed: int) -> None:
        muscle = muscle_like(law, draw)
        assume(one_equilibrium(muscle))
        # A weak braid with a stiff wall may never pull; where most draws are of that kind, hypothesis itself fails.
        assert_no_work(muscle, seed, require=assume)

    check()


BEYOND = [
    "ideal nylon",
    "thick_wall nylon",
    "gas_spring nylon",
    "tondu_lopez",
    "linear_threshold nylon",
    "hyperelastic_braid",
]


@pytest.mark.parametrize("name", BEYOND)
def test_closed_cycles_yield_no_work_beyond_the_working_range(name: str) -> None:
    for seed in range(6):
        assert_no_work(examples()[name], seed, longest=1.3)


def test_cycles_run_through_slack_and_threshold() -> None:
    law = examples()["linear_threshold nylon"]
    for seed in range(6):
        corners = polygon(law, seed)
        closed = np.concatenate([corners, corners[:1]])
        tension = evaluate(law, closed[:, 0], closed[:, 1])["F"]
        assert (tension == 0.0).any()
        assert (tension > 0.0).any()
        assert closed[:, 1].min() < float(law.threshold_pressure) < closed[:, 1].max()


def test_the_printed_volume_makes_energy_from_nothing() -> None:
    # Eq. 12 with the volume of eq. 38b at every pressure, as Part IV computes: DESIGN.md expects about 0.65 J a cycle
    # of the nylon muscle, which is Pth times the change of volume over the stroke. Shows that the test can fail.
    law = examples()["linear_threshold nylon"]

    def printed(span: np.ndarray, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return unilateral(law)(span, pressure)[0], unilateral(law)(span, np.full_like(pressure, 5e5))[1]

    # Filled long, emptied short: the gas would give back less than the load got.
    corners = np.array([[0.154, 0.0], [0.154, 5e5], [0.125, 5e5], [0.125, 0.0]])
    load, gas, exchanged, _ = works(printed, corners, threshold_levels(law))
    assert abs(load - gas) > 0.05 * exchanged
    load, gas, exchanged, _ = works(unilateral(law), corners, threshold_levels(law))
    assert abs(load - gas) <= 1e-8 * exchanged
