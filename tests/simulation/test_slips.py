"""Laws of values where they enter: nothing that can hardly be meant is taken in silence, and nothing ends in a traceback.

Every argument that is a number is tried a thousand times too large and too small, negative, not a number, infinite, with
the unit of another dimension, and as something else than a number.
"""

import contextlib
import dataclasses
import math
import warnings
from importlib import resources

import pytest

import mckibben as mk
from mckibben.muscles.plausible import SLIP, span_cautions
from mckibben.quantities import amounts
from mckibben.simulation import air as air_module
from mckibben.simulation.mechanisms import Stated
from mckibben.simulation.recorded import described
from mckibben.simulation.stepping import SaidCommands
from mckibben.slips import USUAL_SIZES

MECHANISMS = {
    "weight": (mk.Weight, {"muscle": "nylon", "mass": 5.0, "start": 0.126, "damping": 2.0, "gravity": 9.81}),
    "spring": (mk.Spring, {"muscle": "nylon", "stiffness": 2e3, "mass": 0.1, "start": 0.13, "damping": 1.0, "weight": 5.0,
                            "relaxed": 0.13}),
    "plate": (mk.Plate, {"muscle": "nylon", "span": 0.126}),
    "joint": (
        mk.Joint,
        {
            "flexor": "nylon", "arm": 0.02, "inertia": 2e-3, "damping": 0.01, "stiffness": 0.5, "gravity_moment": 1.0,
            "span": 0.126, "stops": (-1.5, 1.5), "stop_stiffness": 2e4, "start": 0.1,
        },
    ),
    "link": (
        mk.Link,
        {
            "length": 0.3, "mass": 0.6, "arm": 0.02, "centre": 0.15, "inertia": 2e-3, "damping": 0.01, "stiffness": 0.5,
            "span": 0.126, "stops": (-1.5, 1.5), "stop_stiffness": 2e4, "start": 0.1,
        },
    ),
    "air": (mk.Air, {"supply": 6e5, "port_volume": 2e-6, "heat": 0.2, "tube": (1.0, 4e-3)}),
}  # fmt: skip
ZERO_IS_MEANT = {
    "damping",
    "stiffness",
    "stop_stiffness",
    "gravity",
    "gravity_moment",
    "start",
    "heat",
    "centre",
    "weight",
}
NEGATIVE_IS_MEANT = {"gravity_moment", "start", "stops", "gravity"}


def simulation(kind, values):
    made = MECHANISMS[kind][0](**values)
    if kind == "air":
        return mk.Simulation(mk.Plate("nylon"), made)
    return mk.Simulation(mk.Chain(made) if kind == "link" else made)


def said(make):
    """What is said of a value: the sentence of its error, or those of its cautions, which are Python's warnings too."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            made = make()
        except mk.MckibbenError as error:
            return str(error)
    sentences = [str(one) for one in made.cautions]
    assert {str(w.message) for w in caught} == set(sentences)
    return "; ".join(sentences)


def arguments():
    for kind, (_, values) in MECHANISMS.items():
        for name, value in values.items():
            if not isinstance(value, str):
                yield pytest.param(kind, name, id=f"{kind}-{name}")


ARGUMENTS = list(arguments())


def changed(kind, name, factor):
    value = MECHANISMS[kind][1][name]
    other = tuple(factor(one) for one in value) if isinstance(value, tuple) else factor(value)
    return lambda: simulation(kind, MECHANISMS[kind][1] | {name: other})


@pytest.mark.parametrize("kind", MECHANISMS)
def test_usual_values_are_taken_without_a_word(kind):
    assert said(lambda: simulation(kind, MECHANISMS[kind][1])) == ""


@pytest.mark.parametrize(("kind", "name"), ARGUMENTS)
def test_a_value_a_thousand_times_too_large_is_refused_or_said(kind, name):
    assert said(changed(kind, name, lambda x: 1e3 * x))


@pytest.mark.parametrize(
    ("kind", "name"), [p for p in ARGUMENTS if p.values[1] != "start" or p.values[0] in ("weight", "spring")]
)
def test_a_value_a_thousand_times_too_small_is_refused_or_said(kind, name):
    assert said(changed(kind, name, lambda x: 1e-3 * x))


@pytest.mark.parametrize(("kind", "name"), ARGUMENTS)
def test_zero_is_refused_or_said_where_it_cannot_be_meant(kind, name):
    what = said(changed(kind, name, lambda x: 0.0 * x))
    meant = (name in ZERO_IS_MEANT or (kind, name) == ("link", "inertia")) and not (
        name == "start" and kind in ("weight", "spring")
    )
    assert bool(what) != meant or (kind, name) == ("spring", "stiffness")


@pytest.mark.parametrize(("kind", "name"), [p for p in ARGUMENTS if p.values[1] not in NEGATIVE_IS_MEANT])
def test_a_negative_value_is_refused_or_said(kind, name):
    assert said(changed(kind, name, lambda x: -x))


@pytest.mark.parametrize("value", [math.nan, math.inf, "5 furlongz", "3 K", "many", None, True, [], {}])
@pytest.mark.parametrize(("kind", "name"), ARGUMENTS)
def test_what_is_no_number_of_that_dimension_is_refused_in_a_sentence(kind, name, value):
    if value is None and "None" in {f.name: f.type for f in dataclasses.fields(MECHANISMS[kind][0])}[name]:
        return  # left out
    assert said(lambda: simulation(kind, MECHANISMS[kind][1] | {name: value}))


def test_every_declared_argument_of_what_one_builds_is_tried():
    for made, values in MECHANISMS.values():
        assert issubclass(made, Stated)
        assert set(amounts(made)) <= set(values)


def test_stops_are_in_order_and_hold_the_start():
    with pytest.raises(
        mk.InputError, match=r"stops must be the smallest and then the largest angle, got '1 and -1 rad'"
    ):
        mk.Joint(stops=(1, -1))
    with pytest.raises(mk.InputError, match="start must be within the stops"):
        mk.Link(0.3, 0.6, start="2.5 rad")
    with pytest.raises(mk.InputError, match="stops must be a pair"):
        mk.Joint(stops=1.0)


# ---- commands


def stepped(**commands):
    valve = commands.pop("valve", "regulator")
    sim = mk.Simulation(mk.Plate("nylon"), mk.Air(valve=valve))
    sim.reset()
    for _ in range(3):
        sim.step(**commands)
    return sim


@pytest.mark.parametrize(
    ("commands", "sentence"),
    [
        ({"muscle": 3.0}, "was 3 bar meant"),
        ({"muscle": 300.0}, "was 300 kPa meant"),
        ({"muscle": 3e8}, "beyond the range of the laws"),
        ({"muscle": -3e5}, "beyond its range, 0 bar and more: it acts as 0 bar"),
        ({"muscle": 3e5, "valve": "MPYE-5-1-8-LF"}, "beyond its range, -1 to 1: it acts as 1"),
        ({"muscle": math.nan}, "finite"),
        ({"muscle": math.inf}, "finite"),
        ({"span": 126.0}, "span must be from 0.1 cm to 20.02 cm"),
        ({"span": 0.0}, "span must be from"),
        ({"span": -0.1}, "span must be from"),
        ({"span": 0.0126}, "can hardly be meant"),
    ],
)
def test_a_command_that_cannot_be_meant_is_refused_or_said_once(commands, sentence):
    what = said(lambda: stepped(**commands))
    assert sentence in what and "; a command" not in what


@pytest.mark.parametrize(
    "commands", [{"muscle": 3e5}, {"muscle": 0.0}, {"muscle": 0.9, "valve": "MPYE-5-1-8-LF"}, {"span": 0.12}]
)
def test_a_usual_command_is_taken_without_a_word(commands):
    assert said(lambda: stepped(**commands)) == ""


def test_a_ramp_of_the_pressure_begins_at_zero_without_a_word():
    sim = mk.Simulation(mk.Plate("nylon"), mk.Air(valve="regulator"))
    sim.reset()
    for k in range(20):
        sim.step(muscle=150.0 * (k + 1))
    assert sim.cautions == ()


def test_the_cautions_of_a_simulation_stand_in_its_recording():
    with pytest.warns(mk.errors.PlausibilityWarning):
        sim = stepped(muscle=3.0)
    assert list(sim.recording().meta["warnings"]) == [str(one) for one in sim.cautions]
    assert "warnings" not in stepped(muscle=3e5).recording().meta


def test_noise_is_said_where_it_is_larger_than_what_it_is_of_and_however_small_it_is_not():
    sim = mk.Simulation(mk.Weight("nylon", mass="1 kg"))
    sizes = {name: USUAL_SIZES[u][1] for name, output in sim.plant.shown if (u := described(output)[0]) in USUAL_SIZES}
    assert {"pressure", "position"} <= set(sizes)
    for share, said in ((1e-9, False), (0.5, False), (1.5, True)):
        noise = {name: share * size for name, size in sizes.items()}
        with pytest.warns(mk.errors.PlausibilityWarning) if said else contextlib.nullcontext():
            sim = mk.Simulation(mk.Weight("nylon", mass="1 kg"), noise=noise)
        about = [one for one in sim.cautions if "noise of" in one.text]
        assert len(about) == (len(sizes) if said else 0)


def test_noise_in_words_is_the_number_that_they_say():
    words, number = (mk.Simulation(mk.Plate("nylon"), noise={"pressure": size}) for size in ("5 mbar", 500.0))
    assert words.reset(3).pressure == number.reset(3).pressure != 0.0
    with pytest.raises(mk.InputError, match="noise of pressure must be a pressure"):
        mk.Simulation(mk.Plate("nylon"), noise={"pressure": "5 N"})


def test_a_start_pressure_is_judged_once():
    sim = mk.Simulation(mk.Plate("nylon"), mk.Air(valve="MPYE-5-1-8-LF"))
    with pytest.warns(mk.errors.PlausibilityWarning, match="beyond the range of the laws"):
        sim.reset(pressure="30 bar")
    assert [one.parameter for one in sim.cautions] == ["start pressure of muscle"]


@pytest.mark.parametrize(("stiffness", "said"), [("100 N/m", True), ("100 N/mm", False), (5e8, True)])
def test_a_tendon_that_can_hardly_be_meant_is_said(stiffness, said):
    with pytest.warns(mk.errors.PlausibilityWarning, match="tendon.stiffness") if said else contextlib.nullcontext():
        sim = mk.Simulation(mk.Plate("nylon", tendon=stiffness))
    assert ("tendon" in repr([one.parameter for one in sim.cautions])) == said


def test_a_refusal_names_what_was_given_as_it_was_given():
    with pytest.raises(mk.InputError, match="links must be one Link or more, .* got 'list, Air'"):
        mk.Chain([], mk.Air())
    with pytest.raises(mk.InputError, match="stops must be from -10 rad to 10 rad, got -60 rad"):
        mk.Joint("nylon", stops=(-60, 60))


def test_a_start_pressure_that_inflates_nothing_is_said():
    sim = mk.Simulation(mk.Plate("nylon"))
    with pytest.warns(mk.errors.PlausibilityWarning, match="was 2 bar meant"):
        sim.reset(pressure=2)
    assert sim.cautions[0].parameter == "start pressure of muscle"
    with pytest.warns(mk.errors.PlausibilityWarning, match="below that of the room"):
        sim.reset(pressure=-2)


def test_a_lane_of_a_batch_says_what_its_simulation_would():
    sim = mk.Simulation(mk.Plate("nylon"))
    batch = sim.batch(3)
    with pytest.warns(mk.errors.PlausibilityWarning, match="it acts as 1"):
        batch.step(muscle=[0.1, 3e5, 0.2])
    assert len(batch.cautions) == 1
    with pytest.raises(mk.InputError, match="finite"):
        batch.step(muscle=[0.1, math.nan, 0.2])


@pytest.mark.parametrize("value", ["3 m", True, "three bar", {}])
def test_a_batch_takes_words_with_a_unit_and_refuses_what_is_no_pressure(value):
    batch = mk.Simulation(mk.Plate("nylon"), mk.Air(valve="regulator")).batch(2)
    batch.step(muscle=["3 bar", "2 bar"])
    assert batch.kernel.commands[batch.commands.index("muscle")].tolist() == [3e5, 2e5]
    with pytest.raises(mk.InputError, match="muscle"):
        batch.step(muscle=value)
    with pytest.raises(mk.InputError, match="rest_length"):
        batch.simulation.batch(2, {"units.muscle.law.rest_length": ["14 cm", "14 bar"]})


def test_what_is_said_of_a_command_is_said_again_of_one_that_is_much_farther_out():
    sim = mk.Simulation(mk.Plate("nylon"), mk.Air(valve="regulator"))
    sim.reset()

    def new(*commands):
        before = len(sim.cautions)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mk.errors.PlausibilityWarning)
            for command in commands:
                sim.step(muscle=command)
        return [str(one) for one in sim.cautions[before:]]

    assert "7.5 bar is beyond the measured ones" in new(7.5e5)[0]
    assert new(7.6e5, 9e5, 7.5e5) == []  # what was said holds of them
    assert "8000 bar is beyond the range of the laws" in new(8e8)[0]
    assert new(7.5e5, 8e8, 9e8) == []
    assert "-0.01 bar is beyond its range" in new(-1e3)[0] and new(-2e3) == []
    assert "was 3 bar meant" in new(3.0)[0] and new(3.0, 2.0) == []  # small and negative are two slips


def test_a_policy_is_judged_by_the_commands_that_it_gave():
    sim = mk.Simulation(mk.Plate("nylon"), mk.Air(valve="regulator"))
    run = sim.rollout(lambda held, seen: {"muscle": held}, steps=3, cost=lambda seen, commands: seen.tension)
    ramp = sim.rollout(lambda top, seen: {"muscle": top * seen.time}, steps=3, cost=lambda seen, commands: seen.tension)
    for quiet in (run, ramp):
        assert said(lambda quiet=quiet: (quiet(1e5), sim)[1]) == ""
    with pytest.warns(mk.errors.PlausibilityWarning, match="was 3 bar meant"):
        run.value_and_grad(3.0)
    with pytest.warns(mk.errors.PlausibilityWarning, match="beyond the range of the laws"):
        run.trajectory(3e8)
    with pytest.raises(mk.InputError, match="muscle must be a finite number"):
        run(math.nan)


def test_a_muscle_that_breaks_or_is_overstretched_is_named():
    made = mk.Joint("nylon", span="15 cm", start=-0.3, stops=(-1.0, 1.0))
    with pytest.warns(mk.errors.PlausibilityWarning, match="overstretched: a span of flexor at the start angle"):
        sim = mk.Simulation(made, mk.Air(valve="regulator"))
    with pytest.raises(mk.errors.ConvergenceError, match="The muscle extensor is longer than its threads bear"):
        for _ in range(100):
            sim.step(moment=60.0)
    batch = sim.batch(2)
    with pytest.raises(mk.errors.ConvergenceError, match="Lane 1 .* muscle extensor is longer than its threads"):
        for _ in range(100):
            batch.step(moment=[0.0, 60.0])


def test_a_span_that_no_one_stated_says_where_it_comes_from():
    with pytest.raises(mk.InputError, match="span of flexor at the start angle of -114.6 deg must be from 1 mm to"):
        mk.Simulation(mk.Joint("nylon", arm="5 cm", start=-2.0))


@pytest.mark.parametrize("changed", [0.30, 0.05, 14.0])
def test_parameters_of_a_lane_and_of_a_copy_are_judged_beside_law_and_span(changed):
    # the law of nylon ends at 15.4 cm; the plate holds it at 12.6 cm
    path = "units.muscle.law.rest_length"
    sim = mk.Simulation(mk.Plate("nylon"))
    assert said(lambda: sim.with_parameters({path: 0.141})) == ""
    assert "a rest length of muscle of" in said(lambda: sim.with_parameters({path: changed}))
    assert "a rest length of muscle of lane 1 of" in said(lambda: sim.batch(3, {path: [0.14, changed, 0.14]}))


def test_a_centre_of_mass_beyond_its_link_is_said():
    assert said(lambda: mk.Simulation(mk.Chain(mk.Link(0.3, 0.6, centre=0.3)))) == ""
    assert "beyond its far end" in said(lambda: mk.Simulation(mk.Chain(mk.Link(0.3, 0.6, centre=0.4))))


def test_a_supply_below_vacuum_is_refused_by_its_own_name_in_gauge():
    with pytest.raises(
        mk.InputError, match=r"supply must be a gauge pressure of vacuum, -1.013 bar, or more, got -6 bar"
    ):
        mk.Simulation(mk.Plate("nylon"), mk.Air(supply="-6 bar"))


@pytest.mark.parametrize(
    ("made", "sentence"),
    [
        (mk.Weight("nylon", mass=5.0, gravity=-9.8), "must be one where the muscle pulls: .* 49 N, got 12.6 cm"),
        (mk.Spring("nylon", relaxed="10 cm"), "must be one where the muscle pulls: .* 80 N, got 14 cm"),
        (mk.Weight("nylon", mass=500.0), "must carry less: 4903 N is not reached: .* at 15.4 cm, its longest"),
        (mk.Weight("nylon", mass=12.0), "must be a longer span"),
    ],
)  # fmt: skip
def test_a_start_that_no_pressure_holds_says_which_way_it_must_go(made, sentence):
    """A longer span does not help where the muscle is too weak at its longest."""
    with pytest.raises(mk.InputError, match=f"start {sentence}"):
        mk.Simulation(made, mk.Air(valve="regulator")).reset()


# ---- spans


def test_a_span_beyond_what_a_muscle_can_take_names_the_lengths():
    with pytest.raises(
        mk.InputError, match=r"span of flexor must be from 1 mm to 20.02 cm for a muscle of 14 cm at rest, got 50 cm"
    ):
        mk.Simulation(mk.Joint("nylon", span="50 cm"))


@pytest.mark.parametrize("span", [0.21, 0.9e-3, 0.0, -0.14, math.nan])
def test_a_span_that_no_muscle_has_is_refused(span):
    """Wherever it is stated, not only where a load declares its own bounds."""
    nylon = mk.muscle("nylon")
    with pytest.raises(mk.InputError, match=r"span must be from 1 mm to 20.02 cm for a muscle of 14 cm at rest, got"):
        span_cautions(span, nylon.law, nylon.rest_length)


@pytest.mark.parametrize(
    "name", ["DMSP-10-250", "DMSP-20-300", "DMSP-40-400", "festo-10mm", "nylon", "fiberglass", "SM20"]
)
def test_a_muscle_is_taut_at_its_default_span_at_half_the_usual_pressure(name):
    sim = mk.Simulation(mk.Plate(name))
    span, law = sim.start_commands()["span"], sim.units["muscle"].law
    # the rule leaves a twentieth of the rest length of a free contraction of a fifth: a tenth of the blocked tension
    assert float(law.tension(span, 2.5e5)) > 0.1 * float(law.tension(mk.muscle(name).rest_length, 2.5e5))


def test_what_a_person_or_a_file_states_is_not_assumed_though_it_equals_the_default(tmp_path):
    def assumed(muscle, air=None):
        return {one.parameter for one in mk.Simulation(mk.Plate(muscle), air).assumptions}

    left = assumed("nylon", mk.Air())
    strain, thread = "units.muscle.largest_strain", "units.muscle.law.thread_strain"
    of_air = {"air.tube.length", "air.tube.diameter", "air.port_volume", "air.heat_conductance"}
    assert {strain} | of_air <= left and thread not in left  # its file states the strain of its threads
    length, bore = air_module.USUAL_TUBE
    stated = mk.Air(
        tube=(float(str(length)), float(str(bore))), port_volume=float(str(air_module.USUAL_PORT)),
        heat=float(str(air_module.USUAL_HEAT)),
    )  # fmt: skip
    assert not of_air & assumed("nylon", stated)
    dimensions = {"thread_length": 0.16, "turns": 3.2}
    assert thread in assumed(mk.muscle("ideal", **dimensions))
    assert thread not in assumed(mk.muscle("ideal", thread_strain=0.005, **dimensions))
    text = (resources.files("mckibben.specimens") / "data" / "nylon.toml").read_text(encoding="utf-8")
    text += '\n[properties.largest_strain]\nvalue = 3.5\nunit = "%"\n'
    (tmp_path / "own.toml").write_text(text.replace('id = "nylon"', 'id = "own"'), encoding="utf-8")
    assert strain not in assumed(str(tmp_path / "own.toml"))


def test_a_parameter_that_is_changed_is_judged_as_one_that_is_stated():
    sim = mk.Simulation(mk.Weight("nylon", mass="5 kg"))
    assert said(lambda: sim.with_parameters({"load.mass": "6 kg"})) == ""
    assert "a load.mass of 5 t can hardly be meant" in said(lambda: sim.with_parameters({"load.mass": "5 t"}))
    with pytest.warns(mk.errors.PlausibilityWarning):
        changed = sim.with_parameters({"load.mass": "5 t"})
    assert [one.parameter for one in changed.cautions] == ["load.mass"]


def test_a_set_point_above_the_supply_is_said_also_where_the_supply_is_changed():
    # The muscle stands at 4 bar whatever is asked for above: without a word that is an answer to another question.
    above = "above the supply of 4 bar"
    sim = mk.Simulation(mk.Plate("DMSP-20-300"), mk.Air(supply="4 bar", valve="regulator"))
    before = sim.cautions
    sim.step(muscle=4e5)
    assert sim.cautions == before
    with pytest.warns(mk.errors.PlausibilityWarning, match=above):
        sim.step(muscle=5e5)
    less = mk.Simulation(mk.Plate("DMSP-20-300"), mk.Air(supply="6 bar", valve="regulator"))
    less = less.with_parameters({"circuit.nodes.supply.pressure_abs": "3 bar"})
    with pytest.warns(mk.errors.PlausibilityWarning, match="above the supply of 1.987 bar"):
        less.step(muscle=4e5)
    whole = mk.Simulation(mk.Plate("DMSP-20-300"), mk.Air(supply="4 bar", valve="regulator"))
    with pytest.warns(mk.errors.PlausibilityWarning, match=above):
        whole.batch(2).step(muscle=[3e5, 5e5])


@pytest.mark.parametrize(
    ("before", "value", "new"),
    [
        (9e5, 0.9 * SLIP * 9e5, False), (9e5, 1.1 * SLIP * 9e5, True),  # above what is usual, 8 bar
        (-2e4, -0.9 * SLIP * 2e4, False), (-2e4, -1.1 * SLIP * 2e4, True),  # below none
        (30.0, 1.1 * 30.0 / SLIP, False), (30.0, 0.9 * 30.0 / SLIP, True),  # too small: the smaller is farther out
    ],
)  # fmt: skip
def test_what_was_said_of_a_command_is_said_again_of_one_that_is_much_farther_out_on_its_side(before, value, new):
    said, high = SaidCommands(), 8e5
    assert said.farther("p", before, high)
    said.keep("p", before, high)
    assert said.farther("p", value, high) is new and said.farther("q", before, high)
    others = {9e5, -2e4, 30.0} - {before}
    assert all(said.farther("p", other, high) for other in others), "each side has its own"
