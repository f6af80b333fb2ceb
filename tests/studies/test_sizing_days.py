"""A sizing with the engineer's own battery, tank and valve, for a day, and with what the inferred numbers leave."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import mckibben as mk
from mckibben.assembly.circuit_file import build_plan
from mckibben.components import Environment
from mckibben.documents import parse_toml
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.muscles import braid
from mckibben.pneumatics.build import valve_from_specimen
from mckibben.specimens import muscle_specimen, save_specimen, specimen
from mckibben.specimens.parts import parts
from mckibben.studies.sizing import (
    LineResult,
    Requirements,
    battery_of,
    design,
    judged,
    of_size,
    of_specimen,
    size,
    sources_for,
    spread_of,
    tank_of,
    valve_of,
)
from mckibben.studies.sizing.as_files import circuit_of, specimen_of, toml_of
from mckibben.studies.sizing.braid_law import INFERRED, braid_law
from mckibben.studies.sizing.candidate import LawAtPressure, air_of_cycle
from mckibben.web.bench.chosen import braid_shape

WISH = Requirements(force=35.0, stroke=0.028, pressure=5e5, frequency=0.5, working_time=4 * 3600.0)
NYLON = judged(of_specimen("nylon", WISH), WISH)
BRAID = judged(design(WISH)[0], WISH)


# ---- a day


def test_a_day_takes_its_cycles_times_one_cycle():
    own = [battery_of("100 Wh"), tank_of("2 l at 200 bar", WISH.environment)]
    found = sources_for(NYLON, WISH, None, own=own)
    assert [s.id for s in found[:2]] == ["own-battery", "own-tank"] or [s.id for s in found[:2]] == [
        "own-tank",
        "own-battery",
    ]
    for s in found:
        assert s.daily == pytest.approx(7200 * s.energy, rel=1e-12)  # 0.5 Hz for 4 h
        if s.cycles:
            assert s.fillings == pytest.approx(7200 / s.cycles, rel=1e-12)


def test_a_battery_lasts_as_long_as_its_energy():
    small = next(s for s in sources_for(NYLON, WISH, None) if s.id == "compressor-small")
    own = sources_for(NYLON, WISH, None, own=[battery_of("50 Wh")])[0]
    assert own.energy == pytest.approx(small.energy, rel=1e-12)
    assert own.cycles == int(50 * 3600 / own.energy)
    twice = sources_for(NYLON, WISH, None, own=[battery_of(100 * 3600.0)])[0]
    assert twice.cycles == pytest.approx(2 * own.cycles, abs=1)  # whole cycles


def test_a_tank_of_ones_own_is_the_shipped_one_of_its_size():
    # the shipped bottle states 460 g for 2 l at 200 bar and 20 degC, to three digits
    tank = tank_of("2 l at 200 bar", Environment())
    assert tank.values["filling"] == pytest.approx(0.460, abs=1e-3)
    shipped = next(s for s in sources_for(NYLON, WISH, None) if s.id == "air-2l-200")
    own = sources_for(NYLON, WISH, None, own=[tank])[0]
    assert own.cycles == pytest.approx(shipped.cycles, rel=3e-3)  # rounding of the shipped filling


@pytest.fixture(scope="module")
def found():
    """A sizing without lines, for a load of which the weight is near the force of the others."""
    return mk.size(
        load="3.5 kg", stroke="2.8 cm", rate="0.5 Hz", working_time="4 h", battery="100 Wh", muscle="nylon", lines=False
    )


def test_a_load_is_its_weight(found):
    assert found.wish.force == pytest.approx(3.5 * 9.80665)
    with pytest.raises(InputError, match="load must be given without a force"):
        mk.size(load="3 kg", force="10 N", stroke="2.8 cm", lines=False)


# ---- ranges


def test_an_answer_lies_within_what_the_inferred_numbers_leave():
    for one in (NYLON, BRAID):
        spread = spread_of(one, WISH)
        assert spread.force[0] <= one.end_force <= spread.force[1]
        assert spread.air[0] <= one.air <= spread.air[1]
        for s in sources_for(one, WISH, None, spread=spread):
            assert s.energy_range[0] <= s.energy <= s.energy_range[1], s.id
            if s.cycles is not None:
                assert s.cycles_range[0] <= s.cycles <= s.cycles_range[1], s.id


def test_the_range_of_an_answer_sums_what_each_inferred_number_moves():
    """The worst of them at once: none of them knows of the others."""
    spread = spread_of(BRAID, WISH)
    one, pairs = BRAID.muscle, BRAID.muscle.law_ends().pairs.values()
    end = one.longest - WISH.stroke
    laws = [[LawAtPressure(law, WISH.pressure) for law in pair] for pair in pairs]
    moves = [[float(law.added(end)) - one.friction - BRAID.end_force for law in pair] for pair in laws]
    moves += [[one.friction - friction for friction in one.friction_range or (one.friction,)]]
    assert sum(min(move) < 0.0 for move in moves) > 1 and sum(max(move) > 0.0 for move in moves) > 1
    ends = [sum(pick(0.0, *move) for move in moves) for pick in (min, max)]
    assert np.subtract(spread.force, BRAID.end_force) == pytest.approx(ends, rel=1e-12)  # rounding


def test_the_range_of_a_braid_holds_every_corner_of_one_number():
    """One number alone at its end is inside the range, and the wall by hand moves the air as the law's volume says."""
    m, spread = BRAID.muscle, spread_of(BRAID, WISH)
    assert {"wall_share", "threshold_pressure", "friction"} <= set(spread.from_numbers) and not spread.without_range
    d = m.dimensions
    shape = {
        "thread_length": d["thread_length"], "diameter": d["diameter_90"], "longest": d["longest_length"],
        "shortest": d["longest_length"] - WISH.stroke,
    }  # fmt: skip
    for name in ("wall_share", "threshold_pressure"):
        for end in INFERRED[name].range:
            law = braid_law("linear_threshold", **shape, **{name: end})
            air = air_of_cycle(replace(m, law=law), WISH)
            assert spread.air[0] * (1 - 1e-12) <= air <= spread.air[1] * (1 + 1e-12)


def test_a_number_without_a_range_is_named():
    assert spread_of(NYLON, WISH).without_range == ("stop_stiffness", "thread_strain")


def test_a_source_at_its_poor_end_is_worse_in_everything():
    for s in sources_for(NYLON, WISH, None):
        if s.form == "compressor" and s.cycles is not None:
            # efficiency 0.15 to 0.6 about 0.35, battery 180 to 720 kJ about 360: by hand
            assert s.energy_range == pytest.approx((s.energy * 0.35 / 0.6, s.energy * 0.35 / 0.15), rel=1e-9)
            assert s.cycles_range == (int(180e3 / s.energy_range[1]), int(720e3 / s.energy_range[0]))


# ---- valves of one's own


@pytest.mark.parametrize(
    "numbers",
    [
        "nominal_flow=300 l/min",
        "Cv=0.3",
        "Kv=0.26",
        "C=1.2 l/(s*bar), b=0.3",
        "flow_into_the_room=500 l/min, flow_pressure=6 bar",
        "hole_diameter=2.5 mm",
    ],
)
def test_a_valve_of_a_catalogue_is_built_from_any_of_the_six_sizes(numbers):
    spec = valve_of(f"{numbers}, switching_time=8 ms, mass=60 g, power=3 W")
    built = valve_from_specimen(spec)
    assert 0.5e-8 < float(built.fill.conductance) < 2e-8  # 300 l/min is about 1.2e-8 m^3/(s Pa)
    assert float(built.drive.opening_dead_time) == pytest.approx(4e-3) and spec.property_si("mass", "kg") == 0.06
    assert spec.property_si("current", "A") * spec.property_si("voltage", "V") == pytest.approx(3.0)
    assert "valve.opening_time" in spec.inferred() and "properties.mass" not in spec.inferred()


@pytest.mark.parametrize("kind", ["spool_valve", "pressure_regulator"])
def test_other_kinds_of_valves_are_built_too(kind):
    spec = valve_of(f"kind={kind}, nominal_flow=350 l/min, name=mine")
    assert spec.id == "mine" and valve_from_specimen(spec) is not None


def test_a_valve_by_its_name_is_the_specimen():
    assert valve_of("mhe2-3-2") == specimen("MHE2-3-2")


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: valve_of("MHE2"), "Unknown valve 'MHE2'. Did you mean 'MHE"),
        (lambda: valve_of("Cv=0.3, colour=2"), "Unknown field 'valve.colour'. Three_way_valve has|three_way_valve has"),
        (lambda: valve_of("Cv=0.3, mass=2 m"), "valve.mass"),
        (lambda: valve_of("Cv=0.3, red"), "must be KEY=VALUE"),
        (lambda: valve_of("kind=pump, Cv=0.3"), "Unknown valve.kind 'pump'"),
        (lambda: valve_of("kind=spool_valve, Cv=0.3, switching_time=2 ms"), "valve.switching_time"),
        (lambda: battery_of("100 W"), "battery"),
        (lambda: battery_of(-1.0), "battery must be an energy above 0 J"),
        (lambda: tank_of("2 l", Environment()), "must be a volume and a gauge pressure"),
        (lambda: tank_of("2 l at 900 bar", Environment()), "tank must be filled to 1 bar to 300 bar"),
        (lambda: size(force=50.0, stroke=0.03, muscle="nosuch"), "Unknown muscle 'nosuch'. The candidates are"),
        (lambda: size(force=50.0, stroke=0.03, working_time="8 h"), "working_time needs a frequency"),
    ],
)
def test_what_is_wrong_is_refused_before_anything_is_computed(call, says):
    with pytest.raises(InputError, match=says.replace(".", r"\.").replace("(", r"\(")):
        call()


def test_tables_say_what_the_answer_says(found):
    muscles, sources, day = found.tables()
    assert muscles.cells()[0][0] == found.muscles[0].muscle.id and len(muscles.heads) == len(muscles.cells()[0])
    assert any("43.4" in note for note in muscles.notes)  # of nylon: 43.4 N by the law
    assert sources.cells()[0][0].startswith("own battery of 100 W h")
    assert day.title.startswith("A day of 4 h: 7200 cycles") and np.isclose(found.daily.cycles, 7200)


# ---- files


def test_the_chosen_muscle_as_a_file_pulls_as_was_said(tmp_path):
    part = next(p for p in parts("fluidic_muscle") if p.id == "DMSP-20")
    for one in (BRAID, judged(of_size(part, WISH), WISH)):
        path = tmp_path / "muscle.toml"
        save_specimen(specimen_of(one.muscle, WISH.pressure), path)
        muscle = mk.muscle(path)
        assert muscle.tension(one.muscle.longest, WISH.pressure) == pytest.approx(one.largest_force, rel=1e-12)
        assert muscle.rest_length == pytest.approx(one.muscle.dimensions["rest_length"], rel=1e-12)
    assert specimen_of(NYLON.muscle, WISH.pressure) == specimen("nylon")


def test_the_braid_that_was_sized_is_the_one_that_the_bench_draws(tmp_path):
    save_specimen(specimen_of(BRAID.muscle, WISH.pressure), tmp_path / "muscle.toml")
    shape = braid_shape(muscle_specimen(tmp_path / "muscle.toml"))
    assert shape is not None and shape["inferred"]
    short = BRAID.muscle.longest - WISH.stroke
    wide = braid.diameter(short, thread_length=shape["thread_length"], turns=shape["turns"])
    assert float(wide) == pytest.approx(BRAID.muscle.diameter, rel=1e-9)  # rounding of the file


def test_the_circuit_of_the_answer_has_its_parts():
    own = valve_of("Cv=0.3")
    for one, valve, kind in (
        (BRAID, "MHE2-3-2", "three_way_valve"),
        (NYLON, "MPYE-5-M5", "spool_valve"),
        (NYLON, "MPP-3-1-8", "pressure_regulator"),
        (BRAID, own.id, own.element),
    ):
        line = LineResult(
            valve,
            "PU-4x2",
            0.5,
            0.01,
            0.03,
            0.01,
            0.1,
            0.1,
            1e-6,
            1.0,
            1.0,
            0.01,
            1e-6,
            0.0,
            6e5,
            True,
            (),
            element=kind,
        )
        tables = circuit_of(one, WISH, line, {own.id: own})
        plan = build_plan(parse_toml(toml_of(tables), where="circuit"), where="circuit", digest="")
        law = plan.nodes["muscle"].law
        end = one.muscle.longest - WISH.stroke
        assert float(law.tension(end, 5e5)) == pytest.approx(float(one.muscle.law.tension(end, 5e5)), rel=1e-12)
        built = plan.circuit.elements["valve"]
        expected = valve_from_specimen(own if valve == own.id else specimen(valve))
        assert float(built.fill.conductance) == pytest.approx(float(expected.fill.conductance), rel=1e-9)
        assert float(plan.circuit.elements["tube"].diameter) == pytest.approx(2e-3)
    with pytest.raises(InputError, match="circuit needs a valve and a tube"):
        circuit_of(NYLON, WISH, None, {})


def test_a_requirement_is_stated_once():
    wish = mk.size(force="50 N", stroke="3 cm", lines=False).wish
    for more in ({"force": "10 N"}, {"load": "20 kg"}, {"stroke": "1 cm"}, {"space": "20 cm x 3 cm"}):
        with pytest.raises(InputError, match="must be left out beside a wish"):
            mk.size(wish, lines=False, **more)
    with pytest.raises(InputError, match="must be left out beside a space"):
        mk.size(force="50 N", stroke="3 cm", space="20 cm x 3 cm", length="10 cm", lines=False)


@pytest.mark.parametrize(
    ("stated", "meant"),
    [({"pressure": "3 Pa"}, "3 bar"), ({"stroke": "3 m"}, "3 cm"), ({"force": "50 MN"}, "50 N"), ({"rate": 1e3}, "")],
)
def test_a_requirement_that_can_hardly_be_meant_is_a_caution_of_the_answer(stated, meant):
    usual = {"force": "50 N", "stroke": "3 cm", "pressure": "5 bar"}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", PlausibilityWarning)
        try:
            said = [str(one) for one in mk.size(**usual | stated, lines=False).cautions]
        except InputError as error:
            caught, said = [], [str(error)]  # what is refused says it in its sentence
    assert any(f"was {meant} meant?" in one or not meant for one in said)
    assert not caught or said == [str(w.message) for w in caught]


def test_what_nobody_gave_of_a_valve_is_not_known():
    def line(words):
        sizing = mk.size(force="30 N", stroke="2 cm", muscle="nylon", valve=words)
        table = next(one for one in sizing.tables() if one.title.startswith("Valves"))
        return sizing.to_dict()["lines"][0], table.cells()[0][5:7], sizing.daily

    told, shown, _ = line("Cv=0.3, switching_time=8 ms")
    assert (told["valve_mass"], told["mass"], told["power"]) == (None, None, None)
    assert shown == ["not known", "not known"]
    told, shown, _ = line("Cv=0.3, switching_time=8 ms, mass=60 g, power=3 W")
    # SI of what was given; the power is kept as a current at 24 V
    assert told["valve_mass"] == pytest.approx(0.06, rel=1e-12) and told["power"] == pytest.approx(3.0, rel=1e-12)
    assert shown == ["60", "3.0"]
