"""Beyond its range of lengths a law goes on from one potential: the threads hold, pulled straight or packed side by side."""

import warnings
from dataclasses import replace

import jax.numpy as jnp
import machines
import numpy as np
import pytest

import mckibben as mk
from law_examples import SEATED, examples
from mckibben.assembly.build import unit_from_muscle
from mckibben.components import derivative
from mckibben.engine import held, integrate, ramped
from mckibben.engine.integration import Result
from mckibben.errors import ConvergenceError, PlausibilityWarning
from mckibben.muscles import threads
from mckibben.muscles.check import evaluate
from mckibben.muscles.plausible import LARGEST_STRAIN
from mckibben.specimens import SpecimenNumber

PRESSURES = np.array([0.0, 1e5, 3e5, 6e5, 10e5])  # gauge [Pa]
# Each law once, and the specimens whose laws end where their formula does; the seated ones take minutes to compile.
LAWS = [name for name in examples() if name.split()[0] not in SEATED]


def ends(law):
    """Shortest and longest length of a law [m]."""
    return tuple(float(end) for end in law.length_range())


@pytest.mark.parametrize("name", LAWS)
def test_tension_never_falls_with_the_length_and_gas_never_vanishes(name):
    law = examples()[name]
    rest = float(getattr(law, "rest_length", ends(law)[1]))
    length = np.linspace(0.05, 1.35, 2601)[:, None] * rest
    tension = np.asarray(law.tension(length, PRESSURES))
    assert np.isfinite(tension).all()
    # rounding of the largest of all tensions, of which neighbours are differences
    assert np.diff(tension, axis=0).min() >= -1e-12 * tension.max()
    assert (tension[length[:, 0] > 1.02 * ends(law)[1]] > 0.0).all()
    if law.has_volume():
        assert np.asarray(law.volume(length, PRESSURES)).min() > 0.0


@pytest.mark.parametrize("name", LAWS)
def test_tension_and_its_slope_go_on_where_the_range_ends(name):
    law = examples()[name]
    for end in ends(law):
        beside = end * (1.0 + np.array([-1e-9, 1e-9]))[:, None]
        tension, slope = (
            np.asarray(law.braid_tension(beside, PRESSURES)),
            np.asarray(law.braid_stiffness(beside, PRESSURES)),
        )
        scale = np.abs(slope).max() + float(law.thread_stiffness())
        # a step of 2e-9 lengths moves the tension by its slope, and the slope by less than the threads' over 1e-2 lengths
        assert np.abs(np.diff(tension, axis=0)).max() <= 1e-8 * end * scale
        assert np.abs(np.diff(slope, axis=0)).max() <= 1e-5 * scale


@pytest.mark.parametrize("name", LAWS)
def test_a_law_and_its_threads_have_one_potential(name):
    law = examples()[name]
    shortest, longest = ends(law)
    length = np.concatenate([np.linspace(0.9, 1.0, 7) * shortest, np.linspace(1.0, 1.3, 21) * longest])
    at = evaluate(law, length[:, None], PRESSURES[None, 1:] + 0.5e5)
    taut = at["F"] > 0.0
    # the same mixed derivative in float64
    scale = max(np.abs(at["V_L"]).max(), 1e-300)
    assert np.abs(at["F_P"] + at["V_L"])[taut].max(initial=0.0) <= 1e-12 * scale


@pytest.mark.parametrize("name", LAWS)
def test_within_its_range_a_law_is_its_formulas_to_the_last_bit(name):
    law = examples()[name]
    shortest, longest = ends(law)
    length, pressure = jnp.meshgrid(jnp.linspace(shortest, longest, 17), jnp.asarray(PRESSURES))
    formula = law.elastic_tension(length) - derivative(lambda x: law.gas_energy(x, pressure), length)
    assert np.array_equal(np.asarray(law.braid_tension(length, pressure)), np.asarray(formula))
    volume = derivative(lambda p: law.gas_energy(length, p), pressure)
    assert np.array_equal(np.asarray(law.braid_volume(length, pressure)), np.asarray(volume))


def test_threads_reach_their_stiffness_and_stretch_by_their_strain():
    law = examples()["linear_threshold nylon"].replace(thread_strain=0.005)
    longest = ends(law)[1]
    full = float(law.tension(longest, 10e5))
    assert float(law.thread_stiffness()) == pytest.approx(full / (0.005 * longest), rel=1e-12)
    assert float(law.stiffness(1.02 * longest, 0.0)) == pytest.approx(full / (0.005 * longest), rel=1e-12)
    softer = law.replace(thread_strain=0.01)
    assert float(softer.thread_stiffness()) == pytest.approx(0.5 * float(law.thread_stiffness()), rel=1e-12)


def test_no_formula_is_asked_far_from_its_range():
    class Tripwire(mk.TensionLaw):
        """A law that means nothing 1 % beyond its range."""

        title, cites, fitted = "tripwire", (), ()
        rest_length = mk.quantity("m", (1e-3, 10.0), "rest length", default=0.2)

        def elastic_tension(self, length):
            share = length / self.rest_length
            return jnp.where((share > 1.01) | (share < 0.74), jnp.nan, 50.0 * (share - 0.9))

        def gas_energy(self, length, pressure):
            return pressure * 1e-4 * (1.5 * self.rest_length - length)

        def length_range(self):
            return 0.75 * self.rest_length, self.rest_length

    assert np.isfinite(np.asarray(Tripwire().tension(np.linspace(0.0, 2.0, 101), 3e5))).all()


def test_a_weight_hangs_on_threads_a_little_above_the_longest_length():
    muscle = mk.muscle(
        "tondu_lopez", rest_length="30 cm", rest_radius="1 cm", rest_angle="20 deg", upper_length="30 cm"
    )
    simulation = mk.Simulation(
        mk.Weight(muscle, mass="60 kg", damping=50), mk.Air(supply="6 bar", valve="regulator"), period="2 ms"
    )
    simulation.reset(pressure=3e5)
    for _ in range(2000):
        seen = simulation.step(muscle=1e5)
    assert 0.3 < seen.length < 0.3 * 1.005
    assert seen.tension == pytest.approx(60.0 * 9.80665, rel=2e-3)  # g; it still swings by less than that


def test_a_run_ends_where_threads_break():
    longest = mk.muscle("nylon").longest_length
    simulation = mk.Simulation(
        mk.Plate("nylon", span=longest), mk.Air(supply="6 bar", valve="regulator"), period="2 ms"
    )
    simulation.reset(pressure="2 bar")
    with pytest.warns(PlausibilityWarning, match="overstretched: a command span of"):
        simulation.step(span=(1.0 + 0.9 * LARGEST_STRAIN) * longest, muscle="2 bar")
    with pytest.raises(ConvergenceError, match="The muscle is longer than its threads bear: load it less"):
        simulation.step(span=(1.0 + 1.1 * LARGEST_STRAIN) * longest, muscle="2 bar")


@pytest.mark.parametrize("length", ["15.41 cm", "16 cm"])
def test_every_answer_says_overstretched(length):
    muscle = mk.muscle("nylon")
    for question in (muscle.tension, muscle.volume, muscle.stiffness, muscle.state):
        with pytest.warns(UserWarning, match=f"overstretched: a length of {length} is beyond .* 15.4 cm"):
            question(length, "3 bar")
    assert muscle.law.state(0.16, 3e5).overstretched
    ends = {"15.9 cm": "there its threads hold", "16 cm": "its threads break at 15.94 cm", "30 cm": "no muscle pulls"}
    for length, end in ends.items():
        with pytest.warns(UserWarning, match=f"overstretched: a length of {length} is .*{end}"):
            muscle.tension(length, "3 bar")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        muscle.tension("15.4 cm", "3 bar")


def test_a_run_of_the_engine_ends_with_its_code_where_threads_break():
    longest = machines.unit().law.length_range()[1]
    for share, result in ((0.2, Result.DONE), (1.2, Result.BROKEN)):
        system = machines.plate()
        span = np.linspace(1.0, 1.0 + share * LARGEST_STRAIN, 101) * float(longest)
        still = np.zeros(101)
        signals = {"x": ramped(span), "m.fill": held(still), "m.vent": held(still)}
        start = system.initial({"m": 2e5, "m.port": 2e5}, {name: s.at(0, 0.0, 1e-3) for name, s in signals.items()})
        state, memory = start
        run = integrate(system, state, signals, memory=memory, period=1e-3, step_size=2e-4, raises=False)
        assert run.result is result, run.message
    assert "longer than its threads bear" in run.message


def test_the_strain_at_which_threads_break_is_the_specimen_s_own():
    assert float(unit_from_muscle(mk.muscle("nylon")).largest_strain) == LARGEST_STRAIN
    nylon = mk.specimen("nylon")
    polyamide = replace(nylon, properties=nylon.properties | {"largest_strain": SpecimenNumber(value=20.0, unit="%")})
    unit = unit_from_muscle(mk.muscle(polyamide))
    assert float(unit.breaking_length()) == pytest.approx(1.2 * 0.154, rel=1e-12)


def test_slopes_of_the_threads_are_those_of_their_values():
    x = jnp.linspace(-0.04, 0.05, 181) + 0.12e-4  # no kink of the slopes on a point
    at = lambda length: threads.hold(length, 0.0, 0.01, 0.015)  # noqa: E731
    step = 1e-7
    for part in ("length", "share", "stretch"):
        value = lambda length: getattr(at(length), part)  # noqa: B023, E731
        apart = (value(x + step) - value(x - step)) / (2.0 * step)
        # the error of a central difference is below the third derivative times step^2, 1e-10 of 1/travel^2
        assert np.allclose(derivative(value, x), apart, rtol=0.0, atol=1e-5 * (1.0 if part != "share" else 1.0 / 0.015))
    assert np.allclose(at(x).share, derivative(lambda length: at(length).length, x), rtol=0.0, atol=1e-12)
