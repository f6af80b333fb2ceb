"""What a mechanism builds is what its arguments say: each number at its place, and balance at the start."""

import math

import numpy as np
import pytest

import mckibben as mk
from mckibben.assembly.loads import MomentArm
from mckibben.errors import InputError
from mckibben.quantities import values
from mckibben.simulation.mechanisms import carrying_pressure, ends_in_si, in_si, muscle_unit, published, rest_length

REST = 0.14  # of the muscle that is used here [m]
SOLVED = 1e-6  # relative, of a pressure that is searched


def made(mechanism):
    units = mechanism.units()
    return units, mechanism.load(units), mechanism.spans(units), mechanism.start_pressures(units)


def numbers(load, *names):
    return [float(getattr(load, name)) for name in names]


def test_a_weight_hangs_by_the_pressure_that_carries_it():
    weight = mk.Weight("nylon", mass="3 kg", start="12 cm", damping=7.0, gravity=2.0, tendon=2e5)
    units, load, spans, pressures = made(weight)
    assert numbers(load, "start", "mass", "weight", "damping", "stiffness") == [0.12, 3.0, 6.0, 7.0, 0.0]
    assert load.signal == weight.drives()[0].command == "force" and weight.tendons() == {"muscle": 2e5}
    assert float(units["muscle"].tendon.stiffness) == 2e5
    assert spans == {"muscle": 0.12} and weight.usual_spans(units) == {}
    assert float(units["muscle"].law.tension(0.12, pressures["muscle"])) == pytest.approx(6.0, rel=SOLVED)
    usual = mk.Weight("nylon").usual_spans(units)["start"]
    assert usual[0] == mk.Weight("nylon").spans(units)["muscle"] == pytest.approx(0.9 * REST, rel=1e-12)
    assert values(mk.Weight("nylon").load(units))["weight"] == pytest.approx(5.0 * 9.80665, rel=1e-12)


@pytest.mark.parametrize("relaxed", [None, 0.135])
@pytest.mark.parametrize("start", [None, "13 cm", "30 N"])
def test_a_spring_begins_in_balance_wherever_it_is_said_to_begin(start, relaxed):
    spring = mk.Spring("nylon", stiffness="2 N/mm", mass=0.3, start=start, damping=4.0, weight="20 N", relaxed=relaxed)
    units, load, spans, pressures = made(spring)
    span, at_rest = spans["muscle"], relaxed
    if at_rest is None:
        at_rest = REST if start != "13 cm" else 0.13
    assert numbers(load, "mass", "weight", "stiffness", "damping") == [0.3, 20.0, 2000.0, 4.0]
    assert numbers(load, "start", "spring_rest") == [span, at_rest]
    assert span == pytest.approx({None: REST, "13 cm": 0.13, "30 N": at_rest - 10.0 / 2000.0}[start], rel=1e-12)
    assert ("start" in spring.usual_spans(units)) == (start is None)
    pull = 20.0 + 2000.0 * (at_rest - span)
    assert start != "30 N" or pull == pytest.approx(30.0, rel=1e-9)
    assert float(units["muscle"].law.tension(span, pressures["muscle"])) == pytest.approx(pull, rel=SOLVED)


def test_a_relaxed_spring_needs_no_pressure_and_one_without_stiffness_is_none():
    spring = mk.Spring("nylon")
    assert spring.start_pressures(spring.units()) == {}
    with pytest.raises(InputError, match="stiffness must be above 0 N/m"):
        mk.Spring("nylon", stiffness=0.0).load(spring.units())
    with pytest.raises(InputError, match="mass"):
        mk.Spring("nylon", start="30 N", mass="3 s")


def test_a_plate_holds_its_muscle_where_it_is_and_goes_as_far_as_the_muscle():
    plate = mk.Plate("nylon", span="13 cm")
    units, load, spans, _ = made(plate)
    assert spans == {"muscle": 0.13} and plate.start_commands(units) == {"span": 0.13} and load.signal == "span"
    (free,), (drive,) = plate.drives(), plate.drives(units)
    assert free.range == (1e-3, math.inf) and drive.hard and drive.straight
    least, most = drive.range
    assert 0.0 < least < drive.usual[0] == 0.5 * drive.usual[1] and drive.usual[1] <= most < 1.0
    assert plate.usual_spans(units) == {} and mk.Plate("nylon").usual_spans(units)["span"][0] < REST


JOINT = {
    "damping": 0.02, "stiffness": 3.0, "gravity_moment": 1.5, "inertia": 4e-3, "start": 0.3, "stop_stiffness": 5e3,
}  # fmt: skip


def test_a_joint_is_turned_one_way_by_its_flexor_and_back_by_its_extensor():
    joint = mk.Joint("nylon", arm=("2 cm", "1 cm"), span=0.13, stops=("-20 deg", 0.5), tendon=1e5, **JOINT)
    units, load, spans, _ = made(joint)
    assert numbers(load, *JOINT) == [*JOINT.values()] and load.signal == "moment"
    assert numbers(load, "lower_stop", "upper_stop") == pytest.approx([math.radians(-20.0), 0.5], rel=1e-12)
    assert {n: a.coefficients.tolist() for n, a in load.arms.items()} == {"flexor": [0.02], "extensor": [-0.01]}
    assert spans == pytest.approx({"flexor": 0.13 - 0.02 * 0.3, "extensor": 0.13 + 0.01 * 0.3}, rel=1e-12)
    assert joint.start_angles() == {"flexor": 0.3, "extensor": 0.3} and joint.usual_spans(units) == {}
    assert joint.tendons() == {"flexor": 1e5, "extensor": 1e5} and joint.muscles["extensor"] == "nylon"
    assert [*mk.Joint("nylon").usual_spans(units)] == ["span of flexor", "span of extensor"]
    other = mk.Joint("nylon", "fiberglass")
    assert other.muscles == {"flexor": "nylon", "extensor": "fiberglass"}


def test_a_curve_of_a_moment_arm_is_taken_as_it_is_and_mirrored_once():
    curve = MomentArm(coefficients=np.array([0.02, 0.001]), span=0.13)
    against = curve.replace(coefficients=-curve.coefficients)
    for extensor in (curve, against):
        arms = mk.Joint("nylon", arm=(curve, extensor)).load(mk.Joint("nylon").units()).arms
        assert arms["flexor"].coefficients.tolist() == [0.02, 0.001]
        assert arms["extensor"].coefficients.tolist() == [-0.02, -0.001]
    assert mk.Joint("nylon", arm=curve).usual_spans(mk.Joint("nylon").units()) == {}


def test_the_links_of_a_chain_are_rods_unless_they_say_otherwise():
    rod = mk.Link("30 cm", "0.6 kg", extensor=None, arm="2 cm", span=0.13, start=0.2, tendon=1e5)
    own = mk.Link(
        0.25, 0.4, arm=0.015, centre="10 cm", inertia=5e-3, damping=0.03, stiffness=2.0, span=0.12, start=-0.4,
        stops=(-1.0, 1.5), stop_stiffness=3e3,
    )  # fmt: skip
    chain = mk.Chain(rod, own, gravity=3.0)
    units, load, spans, _ = made(chain)
    assert [*chain.muscles] == ["flexor_1", "flexor_2", "extensor_2"]
    assert chain.start_angles() == {"flexor_1": 0.2, "flexor_2": -0.4, "extensor_2": -0.4}
    assert chain.tendons() == {"flexor_1": 1e5, "flexor_2": None, "extensor_2": None}
    names = (
        "length", "mass", "centre", "inertia", "damping", "stiffness", "start", "lower_stop", "upper_stop",
        "stop_stiffness",
    )  # fmt: skip
    first, second = (chain.links[k].chain_link(k + 1) for k in range(2))
    assert numbers(first, *names[:4]) == pytest.approx([0.3, 0.6, 0.15, 0.6 * 0.3**2 / 12.0], rel=1e-12)
    assert numbers(second, *names) == [0.25, 0.4, 0.1, 5e-3, 0.03, 2.0, -0.4, -1.0, 1.5, 3e3]
    assert [first.signal, second.signal] == [d.command for d in chain.drives()] == ["moment_1", "moment_2"]
    assert spans == pytest.approx(
        {"flexor_1": 0.13 - 0.02 * 0.2, "flexor_2": 0.12 + 0.015 * 0.4, "extensor_2": 0.12 - 0.015 * 0.4}, rel=1e-12
    )
    assert float(load.gravity) == 3.0 and chain.usual_spans(units) == {}
    usual = mk.Chain(mk.Link(0.3, 0.6, extensor=None), mk.Link(0.3, 0.6)).usual_spans(units)
    assert [*usual] == ["span of flexor_1", "span of flexor_2", "span of extensor_2"]
    beyond = mk.Chain(rod, mk.Link(0.25, 0.4, centre=0.3, span=0.13)).cautions(units)
    assert [str(c) for c in beyond if "centre" in str(c)] == [
        "a centre of link 2 of 30 cm is beyond its far end: the link is 25 cm long"
    ]
    assert set(chain.fields()) == {
        "angle_1", "angle_2", "velocity_1", "velocity_2", "tip_across", "tip_height",
    }  # fmt: skip


def test_a_muscle_is_as_long_at_rest_as_its_specimen_or_its_law_says():
    unit = muscle_unit("nylon")
    assert rest_length("nylon", unit) == rest_length(mk.muscle("nylon"), unit) == rest_length(unit, unit) == REST
    assert published("nylon").id == published(mk.muscle("nylon")).id == published(published("nylon")).id == "nylon"
    assert published(unit) is None
    festo = muscle_unit("DMSP-10-250")
    longer = festo.replace(law=festo.law.replace(rest_length=0.3))
    assert rest_length(longer, longer) == 0.3


def test_a_pressure_that_carries_is_refused_with_the_way_the_start_must_go():
    unit = muscle_unit("nylon")
    for tension, span, said in (
        (-5.0, 0.13, "what it carries there pushes it with 5 N"),
        (1e6, 0.13, "must carry less: 1e\\+06 N is not reached"),
        (200.0, 0.08, "must be a longer span"),
        (0.0, 0.16, "must be a shorter span"),
    ):
        with pytest.raises(InputError, match=said):
            carrying_pressure(unit, tension, span)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: in_si(True, "m", "span"), r"span must be a number \[m\] or words with a unit, got 'True'"),
        (lambda: in_si([], "m", "span"), "span must be a number"),
        (lambda: in_si(math.nan, "m", "span"), "span must be a finite number"),
        (lambda: ends_in_si("ab", "m", "range"), "range must be a pair"),
        (lambda: ends_in_si((1.0,), "m", "range"), "range must be a pair"),
        (lambda: ends_in_si((1.0, 1.0), "m", "range"), "the smallest and then the largest"),
        (lambda: mk.Joint("nylon", stops=(1.0, 1.0)), "the smallest and then the largest angle"),
        (lambda: mk.Joint("nylon", stops=(-1.0, 1.0, 2.0)), "must be a pair"),
        (lambda: mk.Joint("nylon", stops=(-11.0, 1.0)), "stops must be from -10 rad to 10 rad"),
        (lambda: mk.Joint("nylon", stops=(-1.0, 1.0), start=1.1), "must be within the stops, -1 rad to 1 rad"),
        (lambda: mk.Joint("nylon", arm=0.0).load(mk.Joint("nylon").units()), "moment arm above 0 m and up to 1 m"),
        (lambda: mk.Joint("nylon", arm=1.1).load(mk.Joint("nylon").units()), "moment arm above 0 m and up to 1 m"),
        (lambda: mk.Chain("a"), "links must be one Link or more.*got 'str'"),
    ],
)
def test_what_is_no_amount_range_or_arm_is_refused_by_its_name(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_ends_of_a_range_are_read_in_any_unit_and_an_arm_may_be_as_long_as_a_metre():
    assert ends_in_si(["1 cm", 0.2], "m", "range") == (0.01, 0.2)
    assert in_si(np.float32(2.0), "m", "span") == 2.0
    arms = mk.Joint("nylon", arm=1.0, span=0.13).load(mk.Joint("nylon").units()).arms
    assert float(arms["flexor"].coefficients[0]) == 1.0
