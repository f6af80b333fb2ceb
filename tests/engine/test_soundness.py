"""Laws of the codes of samples and of the balances behind them."""

import numpy as np
import pytest
from scipy.optimize import brentq

from mckibben.assembly.build import rig_cord, unit_from_specimen
from mckibben.components.system import Exchange, System
from mckibben.engine import Signal, held, integrate, integration
from mckibben.engine.integration import Result
from mckibben.engine.sampled import MOST_HALVED, Steps
from mckibben.engine.soundness import (
    LEAST,
    MEANINGS,
    OPEN,
    QUIET,
    Soundness,
    balance_errors,
    overloaded_parts,
    possible,
    soundness,
    switched,
    unsound_sentence,
)
from mckibben.errors import ConvergenceError
from mckibben.simulation import Air, Plate, Simulation


def fast_plate(period: float = 2e-3):
    """A nylon muscle whose plate jumps by a centimetre at 5 m/s while its valve fills and vents: hard on any step."""
    return Simulation(Plate("nylon", span=0.13), Air(supply="6 bar"), period=period)


class Anything:
    """A system of which every finite state can be."""

    def admissible(self, state):
        return np.asarray(True)

    def overloaded(self, outputs):
        return {"a": np.asarray(False), "m": outputs["m.broken"]}

    broken = System.broken


def test_a_balance_that_closes_has_no_error_and_one_that_loses_half_has_a_half():
    before, after = {"gas": 10.0, "mechanics": 0.0}, {"gas": 14.0, "mechanics": 1.0}
    closed = balance_errors(before, after, {"gas": Exchange(4.0, 4.0), "mechanics": Exchange(1.0, 1.0)}, 1e-3)
    assert float(closed["gas"]) == 0.0 and float(closed["mechanics"]) == 0.0
    lost = balance_errors(before, after, {"gas": Exchange(8.0, 4.0), "mechanics": Exchange(1.0, 1.0)}, 1e-3)
    at_rest = LEAST + QUIET * 1e-3 * 15.0  # what may be exchanged in this time of the 15 J that are stored
    assert float(lost["gas"]) == pytest.approx(4.0 / (8.0 + at_rest), rel=1e-12)  # rounding


@pytest.mark.parametrize("share", [1e-3, 0.3, 0.5, 0.7, 0.999])
def test_a_muscle_switched_if_it_was_slack_for_a_part_of_the_time_however_large(share):
    assert bool(switched([share * 2e-3], 2e-3)) and bool(switched([0.0, share * 2e-3, 2e-3], 2e-3))
    whole = 2e-3 * (1.0 - 1e-12)  # a sum of the parts of a sample
    assert not bool(switched([0.0, whole, 2e-3], 2e-3)) and not bool(switched([], 2e-3))


def test_what_is_lost_where_a_muscle_gets_taut_just_before_a_sample_ends_is_measured_by_what_it_stores():
    # 35 us of a sample of 10 ms are left, and 60 J are stored: 3 mJ are exchanged, and one step of 3 us across the moment is
    # off by 4 uJ, which is 1e-5 of the store in a second at most. A tenth of what is stored, lost in the sample, is not.
    for lost, closes in ((4e-6, True), (6.0, False)):
        error = balance_errors({"gas": 60.0}, {"gas": 60.003 - lost}, {"gas": Exchange(0.003, 0.003)}, 1e-2)["gas"]
        assert bool(float(error) < OPEN) is closes


def test_at_rest_rounding_is_no_imbalance():
    energy, rounding = 1.4e3, 1e-12  # of a large muscle [J], and what a sum of such numbers is off by
    at_rest = balance_errors({"gas": energy}, {"gas": energy + rounding}, {"gas": Exchange(0.0, 0.0)}, 1e-3)
    assert float(at_rest["gas"]) < 1e-5 < OPEN and rounding < LEAST


@pytest.mark.parametrize(
    ("state", "errors", "broken", "code"),
    [
        (1.0, {"gas": 0.0, "mechanics": 0.5 * OPEN}, False, Soundness.SOUND),
        (1.0, {"gas": 2.0 * OPEN, "mechanics": 0.0}, False, Soundness.GAS),
        (1.0, {"gas": 2.0 * OPEN, "mechanics": 3.0 * OPEN}, False, Soundness.MECHANICS),
        (1.0, {"gas": 3.0 * OPEN, "mechanics": 2.0 * OPEN}, False, Soundness.GAS),
        (1.0, {"gas": 2.0 * OPEN, "mechanics": 0.0}, True, Soundness.BROKEN),
        (np.nan, {"gas": 0.0, "mechanics": 0.0}, True, Soundness.IMPOSSIBLE),
    ],
)
def test_the_code_is_that_of_the_worst_balance_before_it_broken_threads_and_first_an_impossible_state(
    state, errors, broken, code
):
    worst, found = soundness(Anything(), np.float64(state), (), {"m.broken": np.asarray(broken)}, errors)
    assert int(found) == code and float(worst) == max(errors.values())


@pytest.mark.parametrize("wrong", [(np.nan, 0.0), (np.inf, 0.0), (0.0, -np.inf), (np.inf, -np.inf), (np.inf, np.inf)])
def test_a_state_of_which_any_number_is_not_finite_cannot_be(wrong):
    large = 1e300  # far beyond what any state is, and no reason to end a run
    assert bool(possible(Anything(), {"a": np.float64(large), "b": np.zeros(3)}, (np.full(2, -large),)))
    assert not bool(possible(Anything(), {"a": np.float64(wrong[0]), "b": np.zeros(3)}, (np.array([1.0, wrong[1]]),)))


def test_each_code_has_a_meaning_at_its_place():
    assert [int(code) for code in MEANINGS] == list(range(len(Soundness)))  # hosts in C index a table with it


def test_the_sentence_names_the_muscle_that_is_overloaded_and_no_other():
    for parts, named in (((), "A muscle is"), (("muscle",), "The muscle is"), (("m",), "The muscle m is")):
        said = unsound_sentence(float(Soundness.BROKEN), 0.0, 2e-4, parts)
        assert said.startswith(f"{named} longer than its threads bear: load it less")
    assert overloaded_parts(Anything(), {"m.broken": np.array([False, True, False])}) == ("m",)
    assert overloaded_parts(Anything(), {"m.broken": np.array([False])}) == ()
    assert "muscle" not in unsound_sentence(float(Soundness.GAS), 0.1, 2e-4, ("m",))


def test_the_sentence_names_balance_error_and_step():
    text = unsound_sentence(float(Soundness.MECHANICS), 0.42, 2e-4)
    assert "mechanics" in text and "42 %" in text and "0.0002 s" in text


def test_steps_are_halved_while_a_balance_does_not_close_and_not_for_ever():
    steps, halved = Steps(), []
    while (again := steps.after(1e3, float(Soundness.GAS), 1e-4)) is not None:
        assert again.split == 2 * steps.split and not again.stiff
        halved.append(again)
        steps = again
    assert halved[-1].split == MOST_HALVED
    assert Steps(4).after(1e3, float(Soundness.SOUND), 1e-4) == Steps(4)


def run(step_size, **options):
    """A run of the engine with a plate that moves fast."""
    sim = fast_plate()
    carry, _ = sim.rest_state("2 bar")
    state, memory, _ = sim.programs.layouts.carry.unpack(np.array(carry))
    spans = np.where(np.arange(21) % 2 == 0, 0.13, 0.14)
    valve = np.where(np.arange(21) % 4 < 2, 1.0, -1.0)
    signals = {"span": Signal(spans, straight=True), "muscle.valve": held(valve)}
    return integrate(
        sim.machine, state, signals, period=2e-3, memory=memory, step_size=step_size, method="rk4", **options
    )


def test_a_run_halves_a_step_with_which_a_balance_does_not_close(monkeypatch):
    monkeypatch.setattr(integration, "OPEN", 2e-5)  # it closes to 3e-5 with 0.2 ms
    assert run(2e-4).step <= 1e-4


def test_a_run_whose_balance_does_not_close_ends_with_a_sentence(monkeypatch):
    monkeypatch.setattr(integration, "OPEN", 1e-12)  # no step is short enough for that
    failed = run(2e-4, raises=False)
    assert (
        failed.result is Result.UNBALANCED
        and "balance" in failed.message
        and "% of what was exchanged" in failed.message
    )
    with pytest.raises(ConvergenceError, match="does not close"):
        run(2e-4)


def test_the_damping_of_a_tight_cord_on_its_end_mass_is_a_mode():
    unit = unit_from_specimen("DMSP-40-400", tendon=rig_cord())
    sim = Simulation(Plate(unit, span=0.38), Air(supply="8 bar", valve="regulator"), period=5e-3)
    seen = sim.reset(pressure=6e5)
    damping = float(unit.tendon.loss) * seen.tension / float(unit.end_mass)  # that of a line of the Jacobian [1/s]
    assert (
        sim._kernel.rate_bound >= damping > 2e4
    )  # at the usual step of 0.2 ms Runge-Kutta is unstable from 1.4e4 1/s on
    for _ in range(40):
        seen = sim.step(muscle=6e5)
    assert seen.pressure == pytest.approx(6e5, rel=1e-9)

    def pull(length):  # of law and cord, which are equal at rest
        return unit.law.tension(length, 6e5), unit.tendon.force(0.38 - length)

    length = brentq(lambda x: float(np.subtract(*pull(x))), 0.3, 0.38, xtol=1e-12)
    assert seen.tension == pytest.approx(float(pull(length)[0]), rel=1e-5)
