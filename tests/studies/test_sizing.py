"""A muscle that is proposed does what was promised: by its law, and on a simulated machine; and size goes with the wish."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.assembly.build import single_muscle
from mckibben.assembly.loads import PlateLoad
from mckibben.citations import known_keys
from mckibben.engine import integrate
from mckibben.engine.signals import held
from mckibben.errors import InputError
from mckibben.muscles import braid
from mckibben.muscles.elements import Tendon
from mckibben.muscles.laws.thick_wall import ThickWall
from mckibben.pneumatics.build import valve_from_specimen
from mckibben.pneumatics.tubes import LumpedTube
from mckibben.pneumatics.valves import SpoolValve
from mckibben.specimens import specimen
from mckibben.specimens.parts import KINDS, parts, read_parts
from mckibben.studies.sizing import (
    BRAID_LAWS,
    INFERRED,
    OBJECTIVES,
    Requirements,
    braid_law,
    design,
    error_of_braid,
    error_of_specimen,
    judged,
    lines,
    lines_for,
    of_size,
    of_specimen,
    of_specimens,
    rank,
    size,
    sources_for,
    unit_of,
    valve_of,
)
from mckibben.studies.sizing._circuit import courses, settled_courses
from mckibben.studies.sizing.braid import frontier
from mckibben.studies.sizing.candidate import LawAtPressure, air_of_cycle, ranked
from mckibben.studies.sizing.sources import adiabatic_work

WISH = Requirements(force=50.0, stroke=0.03, pressure=5e5)


def later(*case):
    """A case that is left to the slow tests."""
    return pytest.param(*case, marks=pytest.mark.slow)


# Wishes that a muscle of the papers or of the maps meets by its own numbers, with its friction and its error taken off.
MET = {
    "nylon": Requirements(force=35.0, stroke=0.028, pressure=5e5),
    "bridgestone": Requirements(force=100.0, stroke=0.015, pressure=5e5),
    "DMSP-20-300": Requirements(force=500.0, stroke=0.03, pressure=5e5),
}


@pytest.mark.parametrize("law", BRAID_LAWS)
@pytest.mark.parametrize("objective", OBJECTIVES)
def test_a_braid_keeps_its_promise_by_its_own_law(law, objective):
    made, misses = design(WISH, law=law, objective=objective)
    assert made is not None and not misses
    d = made.dimensions
    short = d["longest_length"] - WISH.stroke
    pull, end = (float(made.law.tension(x, WISH.pressure)) for x in (d["longest_length"], short))
    # Friction and error are deducted; the closed form is the law's own, so that only rounding is left.
    bare = max(float(made.law.tension(short, 0.0)), 0.0)  # what it pulls without gas is not counted
    assert end - bare - made.friction - made.error.share * pull == pytest.approx(WISH.force, rel=1e-9)
    assert float(braid.length_at(d["braid_angle"], thread_length=d["thread_length"])) == pytest.approx(
        d["longest_length"], rel=1e-9
    )
    assert made.diameter == pytest.approx(
        float(braid.diameter(short, thread_length=d["thread_length"], turns=d["turns"])), rel=1e-9
    )
    assert short >= INFERRED["slenderness"].value * made.diameter * (1 - 1e-9)


def test_the_chain_from_braid_to_line_is_the_papers():
    # eq. 10 of the nylon muscle over 10-14 cm: printed Kg = 0.461 cm, to the digits printed
    b, d0 = 0.1642, 0.0166
    made = braid_law("linear_threshold", thread_length=b, diameter=d0, longest=0.14, shortest=0.10)
    assert float(made.stiffness_per_pressure) == pytest.approx(0.461e-2, abs=0.5e-5)
    assert float(made.threshold_pressure) == pytest.approx(0.903e5)


def test_the_error_of_a_braid_is_what_its_law_misses_on_the_nylon_muscle():
    laws = {law: error_of_braid(law, 5e5) for law in BRAID_LAWS}
    shape = specimen("nylon").laws["thick_wall"]
    thick = ThickWall(thread_length=0.1642, turns=shape["turns"].value, wall_thickness=0.0762e-2, upper_length=0.154)
    # By hand at one length: the miss there is no larger than the stated one.
    at = 0.13
    printed = 0.466e-2 * (5e5 - 0.062e5) * (at - 0.0991) - 16.0  # eq. 13
    missed = abs(float(thick.tension(at, 5e5)) - printed) / float(thick.tension(0.154, 5e5))
    assert missed <= laws["thick_wall"].share
    # Each step of the chain of the paper makes it better: wall, then threshold and bladder.
    assert laws["linear_threshold"].share < laws["thick_wall"].share < laws["ideal"].share
    assert laws["linear_threshold"].share < 0.15  # inside the published 10-20 %


def test_the_error_of_a_mapped_muscle_is_its_largest_on_the_map():
    found = error_of_specimen(specimen("DMSP-20-300"), "hyperelastic_braid")
    assert found.kind == "measured" and "on the map that ships with this file" in found.source
    assert 0.003 < found.share < 0.012  # rmse of 5.03 N of 1653 N is 0.3 %; the law states at most 2.4 % beyond 4 bar


@pytest.mark.parametrize("law", BRAID_LAWS)
def test_force_goes_with_the_square_of_the_diameter(law):
    small, large = (design(replace(WISH, force=f), law=law)[0] for f in (20.0, 180.0))
    # Without a space the same shape is best for both but for the fittings' mass; so ask the law at one shape.
    d = small.dimensions
    made = [
        braid_law(
            law, thread_length=d["thread_length"], diameter=k * d["diameter_90"],
            longest=d["longest_length"], shortest=d["longest_length"] - WISH.stroke,
        ).tension(jnp.linspace(d["longest_length"] - WISH.stroke, d["longest_length"], 7), 4e5)
        for k in (1.0, 3.0)
    ]  # fmt: skip
    np.testing.assert_allclose(made[1], 9.0 * made[0], rtol=1e-9)
    assert large.dimensions["diameter_90"] > 2.0 * small.dimensions["diameter_90"]


@pytest.mark.parametrize("space", [{}, {"length": 0.25, "diameter": 0.03}])
def test_more_force_never_takes_a_smaller_muscle(space):
    masses = [design(replace(WISH, force=f, **space))[0].mass for f in np.geomspace(5.0, 80.0, 9)]
    # A refined grid finds the least to a few millionths; each step of the wish is a factor of 1.4.
    assert all(b > a * (1.0 - 1e-5) for a, b in zip(masses[:-1], masses[1:], strict=True))


def test_more_room_never_takes_a_heavier_muscle():
    masses = [design(replace(WISH, length=x))[0].mass for x in (0.17, 0.2, 0.25, 0.4)]
    assert all(b <= a * (1.0 + 1e-5) for a, b in zip(masses[:-1], masses[1:], strict=True))


@pytest.mark.parametrize(
    ("wish", "part", "low", "high"),
    [
        (Requirements(force=500.0, stroke=0.03, pressure=5e5, diameter=0.02, length=0.2), "force", 1.0, 500.0),
        later(Requirements(force=50.0, stroke=0.15, pressure=5e5, length=0.2), "stroke", 0.01, 0.15),
        later(Requirements(force=500.0, stroke=0.03, pressure=2e5, length=0.3), "pressure", 2e5, 20e5),
        later(Requirements(force=50.0, stroke=0.03, pressure=5e5, diameter=0.003), "diameter", 0.003, 0.03),
    ],
)
@pytest.mark.slow
def test_what_stands_in_the_way_is_named_and_would_help(wish, part, low, high):
    made, misses = design(wish)
    assert made is None
    found = {m.part: m for m in misses}
    assert set(found) >= {"force", "stroke", "pressure"}
    assert [m.change for m in misses] == sorted(m.change for m in misses)
    value = found[part].reachable
    assert value is not None and low < value < high or part == "diameter" and low < value
    assert f"{part} of at" in found[part].sentence()
    # Just inside the edge it is reached, and a little outside it is not: the edge is found to a hundredth.
    inside, outside = (1.02, 0.95) if value > getattr(wish, part) else (0.98, 1.05)
    assert design(replace(wish, **{part: inside * value}))[0] is not None
    assert design(replace(wish, **{part: outside * value}))[0] is None


def test_what_pulls_without_gas_is_no_muscle():
    wish = Requirements(
        force=5.0, stroke=0.01, pressure=0.4e5
    )  # below the threshold of 0.903 - 0.425 bar, where no gas pulls
    made, misses = design(wish)
    assert made is None
    by = {m.part: m.reachable for m in misses}
    assert 0.4e5 < by["pressure"] < 2e5 and by["force"] is None
    one = judged(of_specimen("nylon", wish), wish)
    assert one.passive > 0.0 and one.end_force <= 0.0 and one.verdict == "no"  # at 14.4 cm, 4 mm beyond rest


@pytest.mark.parametrize("id_", MET)
def test_the_muscles_of_the_papers_are_found_for_what_they_do(id_):
    found = {one.id: judged(one, MET[id_]) for one in of_specimens(MET[id_])}
    one = found[id_]
    assert one.verdict == "yes", dict(one.margins)
    m = one.muscle
    pull = float(m.law.tension(m.longest - MET[id_].stroke, 5e5)) - m.friction
    assert one.end_force == pytest.approx(pull, rel=1e-9)
    assert one.promised_force == pytest.approx(pull - m.error.share * float(m.law.tension(m.longest, 5e5)), rel=1e-9)
    # The stroke that it says is where the promised force is the wished one.
    at = float(m.law.tension(m.longest - one.stroke, 5e5)) - m.friction - one.error_force
    assert at == pytest.approx(MET[id_].force, rel=1e-4)
    more = judged(m, replace(MET[id_], force=one.promised_force * 1.001))
    assert more.verdict == "within the error"
    assert judged(m, replace(MET[id_], force=one.end_force * 1.001)).verdict == "no"


def test_a_fluidic_muscle_is_cut_as_short_as_does_it():
    wish = MET["DMSP-20-300"]
    part = next(p for p in parts("fluidic_muscle") if p.id == "DMSP-20")
    cut = of_size(part, wish)
    assert judged(cut, wish).margins["force"] >= 0.0
    shorter = of_size(part, replace(wish, length=cut.longest - 0.01))
    assert judged(shorter, wish).margins["force"] < 0.0


def test_a_table_holds_the_interval_of_every_muscle_also_of_those_that_state_none():
    sizing = size(force="50 N", stroke="2 cm", pressure="5 bar", lines=False)
    columns, shown = sizing.data(), sizing.muscles[: sizing.shown]
    assert len({one.interval is None for one in shown}) == 2  # both kinds are there
    assert list(zip(columns["interval_low"], columns["interval_high"], strict=True)) == [
        one.interval or (None, None) for one in shown
    ]
    assert {len(values) for values in columns.values()} == {len(shown)}


def test_those_that_do_it_come_first_with_the_least_air():
    order = ranked([judged(one, MET["nylon"]) for one in of_specimens(MET["nylon"])])
    verdicts = [one.verdict for one in order]
    assert verdicts == sorted(verdicts, key=["yes", "within the error", "no"].index)
    airs = [one.air for one in order if one.verdict == "yes"]
    assert len(airs) > 1 and airs == sorted(airs)


# ---- on a simulated machine


def machine_step(candidate, wish, valve, *, length, tube=3.175e-3, duration=0.3):
    """Tension over time on the whole machine, end mass, tendon and valve included, held at a span."""
    element = valve_from_specimen(specimen(valve))
    # A stiff cord: what the usual one gives at 500 N is 5 mm, and no matter of the muscle.
    cord = Tendon(stiffness=2e6, toe_length=1e-4, loss=0.2)
    machine = single_muscle(
        unit_of(candidate).replace(tendon=cord), PlateLoad(held=("muscle",), span=length), supply=wish.pressure,
        valve=element, tube=LumpedTube(length=wish.tube_length, diameter=tube),
    )  # fmt: skip
    period = 1e-3
    n = round(duration / period)
    command = np.ones(n + 1)
    command[0] = 0.0 if not isinstance(element, SpoolValve) else -1.0
    signals = machine.commands({"muscle.valve": held(command)})
    room = {name: 101325.0 for name in machine.circuit.chambers}
    first = {name: s.at(0, 0.0, period) for name, s in signals.items()}
    state, memory = machine.initial(room, first)
    done = integrate(machine, state, signals, period=period, memory=memory)
    return done.time - period, done.outputs


def reached(candidate, time, outputs, end, needed):
    """From when on the machine's pressure is enough for a force at a length: a braid that was slack rings for longer."""
    pull = np.asarray(candidate.law.tension(jnp.full(time.shape, end), outputs["muscle.pressure"]))
    return float(time[np.flatnonzero(pull < needed)[-1] + 1])


@pytest.mark.slow
def test_a_proposed_muscle_does_it_on_a_simulated_machine_in_the_time_that_was_said():
    wish = replace(WISH, length=0.2, diameter=0.03)
    made, _ = design(wish)
    one = judged(made, wish)
    (line,) = lines_for(one, wish, valves=["MHE2-3-2"], tubes=["paper-1/8"])
    end = made.longest - wish.stroke
    time, outputs = machine_step(made, wish, "MHE2-3-2", length=end)
    pull, length = outputs["muscle.tension"], float(outputs["muscle.length"][-1])
    needed = wish.force + made.friction + one.passive
    assert 0.0 < end - length < 2e-4  # what the cord gives: half its toe and 0.05 mm per 100 N
    assert float(pull[-1]) == pytest.approx(float(made.law.tension(length, wish.pressure)), rel=2e-3)  # not quite full
    assert float(pull[-1]) >= needed
    assert line.to_force == pytest.approx(reached(made, time, outputs, end, needed), rel=0.1, abs=1e-3)  # 1 ms samples


@pytest.mark.slow
@pytest.mark.parametrize("id_", MET)
def test_the_muscles_of_the_papers_do_it_on_a_simulated_machine(id_):
    wish = MET[id_]
    one = judged(of_specimen(id_, wish), wish)
    (line,) = lines_for(one, wish, valves=["MHE4-3-2"], tubes=["paper-1/8"])
    end = one.muscle.longest - wish.stroke
    time, outputs = machine_step(one.muscle, wish, "MHE4-3-2", length=end, duration=1.0)
    needed = wish.force + one.muscle.friction + one.passive
    assert float(outputs["muscle.tension"][-1]) >= needed
    after = reached(one.muscle, time, outputs, end, needed)
    assert line.to_force == pytest.approx(after, rel=0.1, abs=1.5e-3)  # 1 ms samples


def test_a_larger_valve_is_faster_and_a_wider_tube_has_more_air():
    wish = replace(WISH, length=0.2)
    one = judged(design(wish)[0], wish)
    found = lines_for(one, wish, valves=["C100P-80", "MHE2-3-2", "MHE4-3-2"], tubes=["PU-4x2", "PU-6x4"])
    by = {(x.valve, x.tube): x for x in found}
    for tube in ("PU-4x2", "PU-6x4"):
        times = [by[v, tube].rise for v in ("C100P-80", "MHE2-3-2", "MHE4-3-2")]
        assert times == sorted(times, reverse=True)
    for valve in ("C100P-80", "MHE2-3-2", "MHE4-3-2"):
        narrow, wide = by[valve, "PU-4x2"], by[valve, "PU-6x4"]
        assert wide.air > narrow.air and wide.stiffness > narrow.stiffness
        extra = 0.25 * np.pi * (4e-3**2 - 2e-3**2) * wish.tube_length
        # an ideal gas between the pressures of room and supply, at the room's temperature
        assert wide.air - narrow.air == pytest.approx(5e5 * extra / (287.05 * 293.15), rel=1e-9)
    # Behind the smallest valve the wide tube's own volume is what is filled.
    assert by["C100P-80", "PU-6x4"].rise > by["C100P-80", "PU-4x2"].rise
    assert any(x.pareto for x in found) and [x.score for x in found] == sorted(x.score for x in found)


@pytest.mark.slow
def test_a_tension_that_has_not_settled_when_the_valve_is_shut_is_run_for_longer():
    """A third of a time constant of filling is too short, five are the usual. What has settled is within 1 %, and its times
    within 4 %, as `analysis.steps` has it.
    """
    wish = replace(WISH, length=0.2)
    one = judged(design(wish)[0], wish)
    tube = next(p for p in parts("tube") if p.id == "paper-1/8")
    lane = lines._lane(one, wish, specimen("MHE2-3-2"), tube, wish.tube_length, one.muscle.longest)
    short = replace(lane, fills=lane.fills / 15.0)
    (usual,), cut = courses([lane]), courses([short])
    assert usual.settled and not cut[0].settled and cut[0].top < 0.99 * usual.top
    (rest,) = settled_courses([short], cut)
    assert rest.settled and rest.top == pytest.approx(usual.top, rel=0.01)
    assert lines._transitions(cut[0], rest)[0] == pytest.approx(lines._transitions(usual, usual)[0], rel=0.04)


def test_a_line_that_another_beats_in_everything_is_not_pareto_best():
    wish = WISH
    one = judged(design(wish)[0], wish)
    (line,) = lines_for(one, wish, valves=["MHE2-3-2"], tubes=["PU-4x2"])
    worse = replace(line, to_force=2 * line.to_force, mass=2 * line.mass)
    other = replace(line, to_force=0.5 * line.to_force, power=2 * line.power)
    marks = {x.to_force: x.pareto for x in rank([line, worse, other])}
    assert marks == {line.to_force: True, worse.to_force: False, other.to_force: True}


def test_a_line_keeps_up_with_cycles_of_its_whole_rise_and_fall():
    wish = WISH
    one = judged(design(wish)[0], wish)

    def line(frequency):
        return lines_for(one, replace(wish, frequency=frequency), valves=["MHE2-3-2"], tubes=["PU-4x2"])[0]

    plain = line(None)
    fastest = 0.8 / (plain.rise + plain.fall)  # both are from a tenth to nine tenths of the way [Hz]
    assert plain.fall > 0.1 * plain.rise and plain.keeps_up
    assert line(0.99 * fastest).keeps_up and not line(1.01 * fastest).keeps_up


@pytest.mark.slow
def test_a_faster_wish_has_less_margin_of_speed():
    wish = replace(WISH, length=0.25)
    one = judged(design(wish)[0], wish)
    speeds = []
    for valve in ("C100P-80", "MHE4-3-2"):
        (line,) = lines_for(one, replace(wish, speed=0.1), valves=[valve], tubes=["PU-4x2"])
        speeds.append(line.speed)
    assert 0.0 < speeds[0] < speeds[1]  # 23 l/min cannot follow where 400 l/min can


# ---- gas sources


def test_a_bottle_lasts_as_many_cycles_as_its_gas():
    one = judged(of_specimen("nylon", MET["nylon"]), MET["nylon"])
    found = {s.id: s for s in sources_for(one, replace(MET["nylon"], frequency=2.0), None)}
    co2 = found["co2-16g"]
    left = (5e5 + 101325.0) * 21.3e-6 / (188.92 * 293.15)  # [kg] that stays at the muscle's pressure
    # CO2 takes the same room as the air: its mass goes with 1/R
    assert co2.cycles == int((0.016 - left) / (one.air * 287.05 / 188.92))
    assert co2.run_time == pytest.approx(co2.cycles / 2.0)
    assert not found["heated-reservoir"].able and "K is needed" in found["heated-reservoir"].note


def test_compressors_cost_isothermal_work_at_least():
    one = judged(of_specimen("nylon", MET["nylon"]), MET["nylon"])
    for s in sources_for(one, MET["nylon"], None):
        if s.form == "compressor":
            assert s.isothermal < s.adiabatic < s.energy
            assert s.isothermal == pytest.approx(one.air * 287.05 * 293.15 * np.log(601325.0 / 101325.0), rel=1e-9)
    r = 601325.0 / 101325.0
    by_hand = 1004.675 * 293.15 * (r ** (0.4 / 1.4) - 1.0)  # cp of air from R and gamma
    assert adiabatic_work(WISH, 5e5) == pytest.approx(by_hand, rel=1e-9)


def test_the_air_of_a_cycle_is_what_the_ends_hold():
    wish = MET["nylon"]
    one = of_specimen("nylon", wish)
    full = float(one.law.braid_volume(one.longest - wish.stroke, 5e5))
    empty = float(one.law.braid_volume(one.longest, 0.0))
    by_hand = (601325.0 * full - 101325.0 * empty) / (287.05 * 293.15)
    assert air_of_cycle(one, wish) == pytest.approx(by_hand, rel=1e-9)


# ---- the whole, and bad input


def test_an_unreachable_wish_says_what_would_do():
    found = size(Requirements(force=5000.0, stroke=0.05, pressure=3e5, length=0.2, diameter=0.03), lines=False)
    assert not found.reached
    assert found.misses and "nearest is" in found.sentence() and "what would do: " in found.sentence()


def test_the_frontier_is_where_designs_end():
    wish = Requirements(force=1.0, stroke=0.03, pressure=5e5, length=0.25, diameter=0.03)
    (most,) = frontier(wish, np.array([0.03]))
    assert design(replace(wish, force=0.97 * float(most)))[0] is not None
    assert design(replace(wish, force=1.05 * float(most)))[0] is None


def test_the_line_that_no_pressure_moves_is_the_same_at_every_sample():
    one = judged(of_specimen("nylon", MET["nylon"]), MET["nylon"])
    ends = LawAtPressure(one.muscle.law, 5e5)
    # 9.91 cm and the printed Fa, Pa and Kg of eq. 13: zero tension where 0.466 (5 - 0.062) (L - 9.91) = 16
    assert ends.free_length(0.154) == pytest.approx(0.0991 + 16.0 / (0.466e-2 * 4.938e5), abs=2e-5)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"force": 0.0}, "force must be above 0 N"),
        ({"stroke": -0.01}, "stroke"),
        ({"pressure": float("nan")}, "pressure"),
        ({"pressure": 1e8}, "pressure must be above 0 bar, up to 20 bar, got 1000 bar"),
        ({"length": 0.02}, "more than the stroke"),
        ({"speed": 0.0}, "speed"),
        ({"frequency": float("inf")}, "frequency"),
    ],
)
def test_a_wish_that_is_none_is_refused(changes, says):
    with pytest.raises(InputError) as refused:
        replace(WISH, **changes)
    assert says in str(refused.value) and "\n" not in str(refused.value)


def test_unknown_names_are_refused():
    for call in (lambda: design(WISH, law="linear"), lambda: design(WISH, objective="price")):
        with pytest.raises(InputError, match="Known are"):
            call()


@pytest.mark.parametrize("kind", KINDS)
def test_parts_name_their_sources(kind):
    some = parts(kind)
    assert some
    for part in some:
        assert part.sources and set(part.sources) <= set(known_keys()), part.id
        for name, number in part.stated.items():
            assert number.inferred or number.source in known_keys(), (part.id, name)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("schema = 2", "schema must be 1"),
        ('schema = 1\nkind = "pump"', "Unknown kind 'pump'"),
        ('schema = 1\nkind = "tube"\n[a]\nsources = []', "a.title"),
        ('schema = 1\nkind = "tube"\n[a]\ntitle = "a"\nsources = []\ncolour = 1', "a.colour"),
        ('schema = 1\nkind = "tube"\n[a]\ntitle = "a"\nsources = []\nmodulus = { value = 1, unit = "m" }', "a.modulus"),
        (
            'schema = 1\nkind = "tube"\n[a]\ntitle = "a"\nsources = []\nmodulus = { value = "x", unit = "Pa" }',
            "a.modulus",
        ),
    ],
)
def test_a_file_of_parts_that_is_wrong_is_refused(text, says):
    with pytest.raises(InputError) as refused:
        read_parts(text, where="mine.toml")
    assert "mine.toml" in str(refused.value) and says in str(refused.value)


def test_a_valve_by_its_cv_is_one_by_its_nominal_flow():
    """Cv of a passage is converted to a conductance, and so is its nominal flow: 100 l/min of the same b are a Cv."""
    wish = replace(WISH, length=0.2)
    one = judged(design(wish)[0], wish)
    own = valve_of("Cv=0.1, b=0.35, switching_time=4 ms")
    flow = valve_from_specimen(own).fill
    same = valve_of(f"C={float(flow.conductance):.12g} m^3/(s*Pa), b=0.35, switching_time=4 ms, name=same")
    first, second = sorted(lines_for(one, wish, valves=[own, same], tubes=["PU-4x2"]), key=lambda x: x.valve)
    assert (first.valve, second.valve) == ("own-valve", "same")
    assert first.to_force == pytest.approx(second.to_force, rel=1e-6) and first.element == "three_way_valve"
    # Nothing that sets its speed is inferred; without a switching time that is, within 2 to 30 ms of it.
    assert lines.time_range(one, wish, own, first) is None
    loose = valve_of("Cv=0.1, b=0.35")
    (line,) = lines_for(one, wish, valves=[loose], tubes=["PU-4x2"])
    fast, slow = lines.time_range(one, wish, loose, line)
    # a dead time is passed on whole, and of the motion no more than all: 14 ms between the ends at least, 28 at most
    assert fast < line.to_force < slow and 0.014 < slow - fast < 0.029


def test_lanes_are_drawn_at_the_speed_that_was_asked_for():
    from mckibben.studies.sizing._circuit import Lane, courses

    one = of_specimen("nylon", MET["nylon"])
    valve = valve_from_specimen(specimen("MHE4-3-2"))
    lane = Lane(unit_of(one), valve, LumpedTube(length=0.5, diameter=4e-3), 5e5, 5e5, 0.154, stroke=0.028, speed=0.1)
    (course,) = courses([lane])
    assert course.sound
    moving = (course.time > course.turn) & (course.length > 0.154 - 0.027)
    assert -np.polyfit(course.time[moving], course.length[moving], 1)[0] == pytest.approx(0.1, rel=1e-3)
    # Slow against the filling: at the end it pulls what the law says at the supply's pressure, within 2 %.
    end = float(course.tension[-1])
    assert end == pytest.approx(float(one.law.tension(0.126, 5e5)), rel=0.02)
