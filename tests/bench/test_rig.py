"""Rigs as files: what ships is read, everything wrong is named by its path, and limits follow from the parts."""

import copy
import dataclasses
import tomllib
from importlib import resources
from types import SimpleNamespace

import pytest

import mckibben as mk
from mckibben.assembly.build import rig_cord, unit_from_specimen
from mckibben.bench.hardware import stand
from mckibben.bench.rig import SOUND_GRIP, Plumbing, RigFaults
from mckibben.bench.rig_file import read_rig, rig, rig_names
from mckibben.bench.software.interlocks import Trip
from mckibben.components.module import Module
from mckibben.errors import InputError
from mckibben.experiments.read import protocol
from mckibben.muscles.elements import Tendon
from mckibben.pneumatics import compressor, orifice, solenoid, tubes, valves, volume
from mckibben.quantities import declared
from mckibben.recordings.calibration import Calibration, Correction


def document():
    text = (resources.files("mckibben.bench") / "rigs" / "paper.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def test_each_rig_that_ships_says_what_is_inferred():
    assert rig_names() == ["modern", "paper", "paper-isothermal", "stm32f405", "uno"]
    for name in rig_names():
        assert rig(name).inferred


def test_a_rig_with_a_base_is_that_rig_with_its_changes(tmp_path):
    paper, cold = rig("paper"), rig("paper-isothermal")
    changed = {"plumbing.direct.valve.flow_into_the_room": "105 l/min", "plumbing.direct.valve.dead_time": "2 ms"}
    changed |= {f"plumbing.{name}.heat": "isothermal" for name in paper.plumbing}
    same = dict(rig("paper", changed).document) | {key: cold.document[key] for key in ("name", "title", "note")}
    assert cold.document == same and cold.source == paper.source
    own = tmp_path / "own.toml"
    own.write_text(
        'schema = 1\nbase = "modern"\nname = "own"\ntitle = "Own"\n[changes]\n"sensors.tension.high" = "9 N"\n'
    )
    assert float(rig(own).sensors["tension"].high) == 9.0
    own.write_text(own.read_text().replace("modern", "paper-isothermal"))  # a base with a base
    again = rig(own)
    assert again.document["plumbing"] == cold.document["plumbing"]
    assert float(again.sensors["tension"].high) == 9.0


@pytest.mark.parametrize(("name", "trip"), [("pressure", Trip.LOST_PRESSURE), ("tension", Trip.LOST_TENSION)])
def test_a_live_zero_shows_a_wire_that_is_cut(name, trip):
    """The converter reads the least it can, and no transducer that is whole reads less than its own least value."""
    own = rig("modern")
    sensor = own.sensors[name]
    lock = own.watch(next(iter(own.plumbing))).replace(patience=0.0)
    whole = {"pressure": 1e5, "tension": 10.0}

    def code(reading):
        return int(lock.step(lock.initial(), whole | {name: float(reading)}, {}, 0.0, 1e-3)[1])

    assert float(sensor.converter.low) < float(sensor.low)  # it has a live zero
    assert (code(sensor.low), code(sensor.converter.low)) == (Trip.NOTHING, trip)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('base = "papre"', "base"),
        ('base = "paper"\n[motor]\ninertia = "1 kg*m^2"', "motor"),
        (
            'base = "paper"\n[changes]\n"plumbing.direct.heat" = "warm"',
            "must be isothermal, adiabatic, or a conductance",
        ),
    ],
)
def test_a_wrong_base_is_refused(tmp_path, lines, message):
    own = tmp_path / "own.toml"
    own.write_text(f'schema = 1\nname = "own"\ntitle = "Own"\n{lines}\n')
    with pytest.raises(InputError, match=message):
        rig(own)


def test_the_papers_rig_has_what_the_paper_prints():
    # chou1996, Part I (2) and (3)
    paper = rig("paper")
    assert float(paper.computer.timer_resolution) == 1e-6
    assert float(paper.computer.highest_rate) == 5000.0
    assert float(paper.sensors["pressure"].high) == pytest.approx(6.8e5)
    assert float(paper.sensors["tension"].high) == 100.0
    assert {s.converter.bits for s in paper.sensors.values()} == {8}
    assert paper.valve_out.bits == paper.motor_out.bits == 8
    assert float(paper.motor.current_limit) == 24.0
    assert (paper.encoder.steps_per_turn, paper.encoder.counter_bits) == (1600, 24)
    assert float(paper.encoder.pulley_radius) == 0.02
    ten, three = (float(paper.plumbing[n].muscle_accumulator) for n in ("10 in3", "3 in3"))
    # an inch is 2.54 cm
    assert ten == pytest.approx(10 * 0.0254**3, rel=1e-4) and three == pytest.approx(3 * 0.0254**3, rel=1e-4)
    assert paper.plumbing["accumulators"].valve_accumulator == ten
    assert float(paper.plumbing["10 in3"].tube.length) == 1.0


def test_a_rig_goes_to_a_protocol_by_what_it_needs():
    paper, modern = rig("paper"), rig("modern")
    assert paper.layout(protocol("quasi-static")) == "accumulators"
    assert paper.layout(protocol("isotonic-triangle")) == "direct"
    assert modern.layout(protocol("leak-down")) == "tight"
    assert "shut-off" not in paper.parts("direct")


def test_limits_follow_from_the_parts():
    limits = rig("paper").limits("direct")
    assert limits.tension == 100.0 and limits.motor_force == pytest.approx(264.0)
    # the highest code of 8 bits over 10 bar, but no more than the supply
    assert limits.pressure == (0.0, pytest.approx(6.9e5))
    assert limits.resolution["tension"] == pytest.approx(100.0 / 256)
    stronger = rig("paper", {"sensors.tension.high": "500 N", "sensors.tension.converter.high": "500 N"})
    assert stronger.limits("direct").tension == 500.0


WRONG = {
    "unknown table": (("enginge",), {}, "Unknown"),
    "schema": (("schema",), 2, "schema must be 1"),
    "unit": (("motor", "inertia"), "3 kg", "kg"),
    "bounds": (("motor", "pulley_radius"), "20 m", "must be"),
    "bits": (("sensors", "pressure", "converter", "bits"), "eight", "whole number"),
    "many bits": (("sensors", "pressure", "converter", "bits"), 64, "24"),
    "missing": (("sensors", "tension", "converter", "high"), None, "missing"),
    "sensor": (("sensors", "torque"), {}, "Known are pressure, valve_pressure, tension"),
    "no layout": (("plumbing",), None, "one table for each way"),
    "valve": (("plumbing", "direct", "valve", "specimen"), "MPP", "MPP"),
    "tube": (("plumbing", "direct", "tube", "lenght"), "1 m", "Did you mean"),
    "heat": (("plumbing", "direct", "heat"), "warm", "isothermal, adiabatic, or a conductance"),
    "frame": (("frame", "longest"), "1 cm", "must be more than"),
    "hands": (("hands",), [{"ask": "x", "plumbing": "none"}], "Known are direct"),
    "interlocks": (("interlocks", "motor_force"), "200 N", "Unknown"),
    "inferred": (("inferred",), ["motor.colour"], "nothing of that path"),
    "gain": (("control", "force", "kp"), -1.0, "must be"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_in_a_rig_is_named_by_its_path(case):
    path, value, said = WRONG[case]
    changed = copy.deepcopy(document())
    at = changed
    for part in path[:-1]:
        at = at[part]
    if value is None:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    with pytest.raises(InputError) as error:
        read_rig(changed, where="mine.toml")
    assert "mine.toml" in str(error.value) and path[-1] in str(error.value), error.value
    assert said in str(error.value), error.value


# Bounds alone refuse a slip of these, or what is mounted and connected judges them: spans, gauge pressures, temperatures.
JUDGED_ELSEWHERE = {"ambient", "pressure_abs", "temperature", "wall_temperature", "roughness", "linear_band", "start"}
PARTS = [
    part
    for module in (compressor, orifice, solenoid, tubes, valves, volume, stand)
    for part in vars(module).values()
    if isinstance(part, type) and issubclass(part, Module) and part is not Module
]


@pytest.mark.parametrize("part", [*dict.fromkeys(PARTS), Plumbing], ids=lambda part: part.__name__)
def test_each_number_of_a_rig_or_circuit_has_a_usual_range(part):
    """Without one a slip of the unit is silent: bounds are as wide as what somebody may build."""
    wide = {name for name, q in declared(part).items() if q.typical == q.bounds and q.unit not in ("1", "flag")}
    assert wide <= JUDGED_ELSEWHERE


@pytest.mark.parametrize("value", [0.05, "0.05", "5 %"])
def test_a_number_of_python_keeps_its_fraction(value):
    assert mk.rig("modern", {"faults.lost_threads": value}).faults.present == {"lost_threads": 0.05}


def test_an_accumulator_adds_its_volume_to_the_node_it_is_screwed_to():
    machine = rig("paper")
    for one in machine.plumbing.values():
        bare = one.replace(has_muscle=False, valve_accumulator=0.0, muscle_accumulator=2e-4)
        full = bare.replace(valve_accumulator=3e-4, muscle_accumulator=4e-4)
        nodes = [p.circuit({}, machine.environment).nodes for p in (bare, full)]
        sizes = [{name: float(getattr(node, "volume", 0.0)) for name, node in some.items()} for some in nodes]
        added = {name: size - sizes[0][name] for name, size in sizes[1].items()}
        # differences of volumes of 1e-4 m^3
        assert added == pytest.approx(
            {name: {"port": 3e-4, bare.tested: 2e-4}.get(name, 0.0) for name in added}, abs=1e-18
        )
        assert "accumulators" in full.parts() and "accumulators" not in bare.replace(muscle_accumulator=0.0).parts()
        assert full.signals() == (("valve",) if full.shut_off is None else ("valve", "open"))


def test_a_machine_holds_the_muscle_where_its_plumbing_has_one_and_an_accumulator_where_it_has_none():
    paper, unit = rig("paper"), unit_from_specimen("nylon", tendon=rig_cord())
    for name, plumbing in paper.plumbing.items():
        machine = paper.machine(name, unit, start=0.14, moves=True)
        assert list(machine.units) == (["muscle"] if plumbing.has_muscle else [])
        assert (plumbing.tested in machine.circuit.nodes) and list(machine.load.held) == list(machine.units)
    assert {p.has_muscle for p in paper.plumbing.values()} == {True, False}
    assert list(paper.machine("3 in3", None, start=0.14, moves=False).units) == []


def test_a_plumbing_is_the_named_one_and_a_calibration_is_of_the_rig_and_of_channels_that_it_measures():
    paper, plain = rig("paper"), protocol("isometric-step")
    assert paper.layout(plain, "3 in3") == "3 in3" and paper.plumbing[paper.layout(plain)].has_muscle
    with pytest.raises(InputError, match="Unknown plumbing '3 in'. Did you mean '3 in3'"):
        paper.layout(plain, "3 in")
    assert paper.calibrated(None) is paper
    stated = Calibration(rig="paper", created="2026-01-01T00:00:00+00:00")
    assert paper.calibrated(stated).calibration is stated
    with pytest.raises(InputError, match="the calibration has to be of the rig paper"):
        paper.calibrated(dataclasses.replace(stated, rig="modern"))
    with pytest.raises(InputError, match="The rig measures pressure"):
        paper.calibrated(dataclasses.replace(stated, corrections={"colour": Correction(unit="Pa", terms={})}))


def test_a_machine_without_faults_keeps_its_parts_and_each_fault_is_present_alone():
    part, sound = SimpleNamespace(), RigFaults()
    assert sound.present == sound.drifts() == {} and sound.unit(part) is part and sound.plumbing(part) is part
    for name, value in {"leak": 1e-10, "clamp_grip": 50.0, "tension_drift": -3.0, "lost_threads": 0.1}.items():
        assert RigFaults(**{name: value}).present == {name: value}
    assert RigFaults(clamp_grip=SOUND_GRIP, leak=0.0).present == {}
    assert RigFaults(tension_drift=-3.0, span_drift=1e-6).drifts() == {"tension": -3.0, "span": 1e-6}


def test_a_fault_changes_its_part_and_one_without_that_part_is_refused():
    leaks = [
        RigFaults(leak=2e-9).leaking(SimpleNamespace(leak=one)) for one in (None, SimpleNamespace(conductance=1e-9))
    ]
    assert [float(one.conductance) for one in leaks] == pytest.approx([2e-9, 3e-9], rel=1e-12)
    tied = SimpleNamespace(tendon=Tendon(stiffness=1e5, slack_length=0.02))
    assert float(RigFaults(clamp_slack=0.01).slack(tied).slack_length) == pytest.approx(0.03, rel=1e-12)
    assert float(RigFaults(clamp_grip=50.0).slipping().grip) == 50.0
    with pytest.raises(InputError, match="faults: clamp_slack needs a tendon that the clamp holds"):
        RigFaults(clamp_slack=0.01).slack(SimpleNamespace(tendon=None))
    for name in ("valve_blockage", "valve_sticking"):
        with pytest.raises(InputError, match=f"faults.{name} is known of pressure regulators only"):
            RigFaults(**{name: 0.1}).valve(SimpleNamespace(valve=object()))


def test_a_rig_has_resolves_and_allows_what_its_parts_do():
    whole = rig("modern")
    layout = next(iter(whole.plumbing))
    still, blind = dataclasses.replace(whole, motor=None), dataclasses.replace(whole, encoder=None)
    assert whole.parts(layout) >= {"plate", "person", *(f"{name} sensor" for name in whole.sensors)}
    assert whole.parts(layout) - still.parts(layout) == {"motor"}
    assert whole.parts(layout) - blind.parts(layout) == {"span sensor"}
    assert blind.resolution() == {name: float(one.resolution) for name, one in whole.sensors.items()}
    assert whole.resolution() == blind.resolution() | {"span": float(whole.encoder.resolution)}
    moving, held = whole.limits(layout), still.limits(layout)
    assert (moving.motor_force, moving.speed) == (float(whole.motor.largest_force), float(whole.motor.largest_speed))
    assert moving.acceleration == moving.motor_force / float(whole.motor.mass)
    assert (held.motor_force, held.speed, held.acceleration) == (float("inf"), 0.0, float("inf"))
    assert moving.tension == float(whole.sensors["tension"].high) and moving.span == (whole.shortest, whole.longest)
    assert moving.pressure[1] == min(float(whole.valve_out.top), float(whole.plumbing[layout].supply_pressure))
    loose = dataclasses.replace(whole, sensors={"pressure": whole.sensors["pressure"]})
    assert loose.limits(layout).tension == float("inf")
    assert [whole.operator_action(hand.ask) for hand in whole.hands] == list(whole.hands) != []
    assert whole.operator_action("sing") is None
