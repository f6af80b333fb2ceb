"""Mechanisms of a simulation: where they begin, and several joints in a chain."""

import math

import pytest
from stepped_systems import AIR, weight

import mckibben as mk
from mckibben.errors import InputError
from mckibben.quantities import values


def test_a_weight_hangs_still_until_the_valve_moves():
    sim = weight()
    first = sim.reset()
    assert first.tension == pytest.approx(3.0 * 9.80665, rel=0.04)  # the cord yields by half a millimetre
    for _ in range(250):
        seen = sim.step(muscle=0.0)
    assert seen.tension == pytest.approx(3.0 * 9.80665, rel=0.02)  # friction is relaxed where it swung to
    assert abs(seen.position - first.position) < 2e-3
    for _ in range(150):
        seen = sim.step(muscle=0.4)
    assert seen.position < first.position - 1e-3  # the muscle shortens and lifts it


def test_two_links_with_four_muscles_pull_each_other():
    """The reaction of the second joint's muscles turns the first link, which no muscle of its own moves."""
    links = (mk.Link("30 cm", "0.5 kg"), mk.Link("25 cm", "0.3 kg", arm="1.5 cm"))
    sim = mk.Simulation(mk.Chain(*links, gravity=0.0), AIR)
    assert sim.commands[:4] == ("flexor_1", "extensor_1", "flexor_2", "extensor_2")
    sim.reset(pressure="1 bar")
    for _ in range(60):
        seen = sim.step(flexor_2=0.6, extensor_2=-0.6)
    assert seen.angle_2 > 0.1
    assert seen.angle_1 < -1e-3  # the other way, as both links together keep their angular momentum at first


@pytest.mark.parametrize(("tendon", "stated"), [(None, set()), (2e5, {"tendon.stiffness"})])
def test_every_number_of_a_mounting_that_nobody_stated_is_among_what_is_assumed(tendon, stated):
    sim = mk.Simulation(mk.Plate("DMSP-10-250", tendon=tendon), AIR)
    unit = sim.units["muscle"]
    own = {"law.thread_strain": float(unit.law.thread_strain)}  # which its file does not state
    numbers = values(unit) | ({} if tendon is None else {f"tendon.{n}": x for n, x in values(unit.tendon).items()})
    numbers.pop("tendon.slack_length", None)  # 0: the span is that of the muscle
    said = {a.parameter.removeprefix("units.muscle."): a.value for a in sim.assumptions if "muscle." in a.parameter}
    assert said == {name: value for name, value in numbers.items() if name not in stated} | own


def test_words_and_numbers_mean_the_same():
    words = mk.Joint("nylon", arm="2 cm", inertia="20 kg*cm^2", start="10 deg")
    numbers = mk.Joint("nylon", arm=0.02, inertia=2e-3, start=math.radians(10.0))
    loads = [m.load(mk.Simulation(m, AIR).units) for m in (words, numbers)]
    assert float(loads[0].inertia) == pytest.approx(float(loads[1].inertia), rel=1e-12)  # rounding of units
    assert float(loads[0].start) == pytest.approx(float(loads[1].start), rel=1e-12)


def test_a_muscle_is_the_same_by_its_id_and_as_a_value():
    ends = []
    for muscle in ("nylon", mk.muscle("nylon")):
        sim = mk.Simulation(mk.Joint(muscle, arm="2 cm"), AIR)
        sim.reset(pressure="2 bar")
        ends.append(sim.step(flexor=0.2))
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: mk.Chain(), "one Link or more"),
        (lambda: mk.Simulation(mk.Joint(5.0), AIR), "specimen"),
        (lambda: mk.Simulation(mk.Joint("nylon", arm=("2 cm",)), AIR), "pair"),
        (lambda: mk.Simulation(mk.Weight("nylon", mass="500 kg"), AIR).reset(), "not reached"),
        (lambda: mk.Simulation(mk.Plate("nylon", span="5 s"), AIR), "span"),
    ],
)
def test_what_does_not_fit_is_refused(make, word):
    with pytest.raises((InputError, mk.MckibbenError), match=word):
        make()
