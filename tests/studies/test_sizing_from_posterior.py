"""Sizing of a measured muscle by the posterior of its law: a sure law, an unsure one, and what lies beyond the map."""

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.identification.posterior import Posterior, SensorErrors
from mckibben.muscles.build import law_from_specimen
from mckibben.specimens import specimen
from mckibben.studies.sizing import Requirements, of_specimen
from mckibben.studies.sizing.candidate import LawAtPressure
from mckibben.studies.sizing.size import answer_of_posterior

WISH = Requirements(force=40.0, stroke=0.02, pressure=4e5)
LENGTHS, PRESSURES = (a.ravel() for a in np.meshgrid(np.linspace(0.11, 0.154, 5), np.linspace(2e5, 5e5, 3)))


def drawn(amplitude: float, spread: float) -> Posterior:
    """Samples of the nylon muscle's law, around the values that made the map."""
    law = law_from_specimen(specimen("nylon"), "gas_spring")
    chance = np.random.default_rng(0)
    names = ("stiffness_per_pressure", "shortest_length")
    return Posterior(
        law="gas_spring",
        samples={n: float(getattr(law, n)) * (1.0 + spread * chance.standard_normal(200)) for n in names},
        noise=np.ones(200),
        amplitude=np.full(200, amplitude),
        known={n: float(getattr(law, n)) for n in ("rest_length", "upper_length", "rest_volume")},
        points=mk.ForceMap("virtual", LENGTHS, PRESSURES, np.asarray(law.tension(LENGTHS, PRESSURES))),
        errors=SensorErrors(np.full(len(LENGTHS), 0.5), np.zeros((0, len(LENGTHS)))),
        length=0.3,
        seed=0,
        r_hat=1.0,
        effective=200.0,
        divergences=0,
    )


def test_a_posterior_without_spread_answers_as_its_law_does():
    muscle = of_specimen("nylon", WISH)
    answer = answer_of_posterior(drawn(0.0, 0.0), muscle, WISH)
    ends = LawAtPressure(law_from_specimen(specimen("nylon"), "gas_spring"), WISH.pressure)
    force = float(ends.added(muscle.longest - WISH.stroke)) - muscle.friction
    stroke = muscle.longest - ends.last_below(WISH.force + muscle.friction, muscle.longest)
    # the law is nearly straight between two of 64 lengths, 0.7 mm apart
    assert answer.force.low == answer.force.high == pytest.approx(force, rel=1e-3)
    assert answer.stroke.median == pytest.approx(stroke, rel=1e-3)
    assert answer.reached == 1.0 and answer.within


def test_an_unsure_law_and_a_discrepancy_each_widen_the_answer():
    muscle = of_specimen("nylon", WISH)
    wide, wrong, both = (answer_of_posterior(drawn(*case), muscle, WISH) for case in ((0, 0.02), (4.0, 0), (4.0, 0.02)))
    widths = [answer.force.high - answer.force.low for answer in (wide, wrong, both)]
    assert min(widths[:2]) > 0.0
    strong = Requirements(force=float(both.force.median), stroke=0.02, pressure=4e5)
    # half of the samples pull more than their median; of 200 within four standard errors
    assert answer_of_posterior(drawn(4.0, 0.02), muscle, strong).reached == pytest.approx(0.5, abs=0.15)


def test_a_pressure_beyond_the_measured_map_is_said():
    beyond = Requirements(force=40.0, stroke=0.02, pressure=6e5)
    assert not answer_of_posterior(drawn(1.0, 0.02), of_specimen("nylon", beyond), beyond).within


def test_a_posterior_without_its_muscle_is_refused():
    with pytest.raises(InputError, match="posterior is allowed only with muscle"):
        mk.size(force="40 N", stroke="2 cm", posterior=drawn(0.0, 0.0))
