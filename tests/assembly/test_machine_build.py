"""Machines from specimens: what is refused, and that what is built has the parts that were asked for."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.assembly.build import (
    INFERRED,
    AirLine,
    antagonist_pair,
    circuit_for,
    rig_cord,
    rig_unit,
    several,
    single_muscle,
    unit_from_specimen,
)
from mckibben.assembly.loads import Body, MomentArm, PlateLoad
from mckibben.assembly.machine import Machine
from mckibben.assembly.output_names import OUTPUTS, output_meaning
from mckibben.components import paths
from mckibben.engine.signals import Value
from mckibben.errors import InputError
from mckibben.muscles.build import build_law
from mckibben.muscles.hysteresis import Coulomb, MaxwellSlip
from mckibben.pneumatics.build import build_element
from mckibben.pneumatics.tubes import LumpedTube
from mckibben.specimens import specimen

SUPPLY = 6e5
PLATE = PlateLoad(held=("m",), span=0.14)
VALVES = {
    "spool_valve": {"flow_into_the_room": "600 l/min", "flow_pressure": "6.9 bar", "lag": "5 ms"},
    "pressure_regulator": {"flow_into_the_room": "600 l/min", "flow_pressure": "6.9 bar", "band": "0.2 bar"},
}


def test_a_muscle_has_what_its_specimen_states_and_what_is_inferred():
    tied = unit_from_specimen("nylon")
    assert tied.tendon is None and tied.mounting == "tied to its anchors"
    unit = rig_unit("nylon")  # on a rig by its cord
    assert isinstance(unit.friction, MaxwellSlip)
    assert float(unit.law.threshold_pressure) == pytest.approx(0.903e5)
    for name, value in {"end_mass": unit.end_mass, "tendon_stiffness": unit.tendon.stiffness}.items():
        assert float(value) == INFERRED[name].value
    for name, inferred in INFERRED.items():
        low, high = inferred.range
        assert low <= inferred.value <= high, name
    assert float(unit_from_specimen("nylon", tendon=rig_cord(), end_mass=0.05).end_mass) == 0.05
    assert unit_from_specimen("nylon", rubs=False).friction is None
    assert isinstance(unit_from_specimen("nylon", friction="coulomb").friction, Coulomb)


def test_only_coulomb_friction_stated_becomes_one_with_memory():
    nylon = specimen("nylon")
    stated = dataclasses.replace(nylon, friction={"coulomb": nylon.friction["coulomb"]})
    rubbing = unit_from_specimen(stated).friction
    assert isinstance(rubbing, MaxwellSlip)
    assert float(rubbing.largest_force(3e5)) == pytest.approx(2.5)


@pytest.mark.parametrize("kind", VALVES)
def test_a_valve_with_three_ports_is_one_element_of_the_line(kind):
    machine = single_muscle("nylon", PLATE, supply=SUPPLY, valve=build_element(kind, VALVES[kind]))
    assert "m.valve" in machine.signals()
    assert machine.circuit.ends["m.valve"][0] == ("supply", "m.port", "room")


def test_an_own_line_for_each_muscle():
    load = PlateLoad(held=("a", "b"), span=0.14)
    lines = {"a": AirLine(), "b": AirLine(tube=LumpedTube(length=2.0, diameter=4e-3))}
    machine = several({"a": "nylon", "b": "nylon"}, load, supply=SUPPLY, line=lines)
    assert float(machine.circuit.elements["b.tube"].length) == 2.0
    assert machine.signals() == ("a.fill", "a.vent", "b.fill", "b.vent")


ARM, BACK = (MomentArm(coefficients=jnp.array([a]), span=0.14) for a in (0.02, -0.02))
HOLE = build_element("orifice", {"hole_diameter": "2 mm"})
SPRING = build_law(
    "gas_spring", {"stiffness_per_pressure": 5e-3, "shortest_length": 0.1, "rest_length": 0.14, "upper_length": 0.154}
)
REFUSED = {
    "valve's specimen": lambda: unit_from_specimen("MPP-3-1-8"),
    "biological": lambda: unit_from_specimen("fast-fibre"),
    "unknown law": lambda: unit_from_specimen("nylon", law="tondu_lopez"),
    "unknown mechanics": lambda: unit_from_specimen("nylon", weight=3.0),
    "negative mass": lambda: unit_from_specimen("nylon", end_mass=-1.0),
    "unknown part of a line": lambda: single_muscle("nylon", PLATE, supply=SUPPLY, hose=1.0),
    "two muscles as one": lambda: single_muscle("nylon", PlateLoad(held=("a", "b")), supply=SUPPLY),
    "another muscle": lambda: several({"n": "nylon"}, PLATE, supply=SUPPLY),
    "no muscle": lambda: several({}, PlateLoad(held=()), supply=SUPPLY),
    "no line": lambda: several({"m": "nylon"}, PLATE, supply=SUPPLY, line={}),
    "no tank": lambda: circuit_for({"m": unit_from_specimen("nylon")}, supply=SUPPLY, feed=HOLE),
    "a leak as a valve": lambda: single_muscle(
        "nylon", PLATE, supply=SUPPLY, valve=build_element("leak", {"length": "1 m", "diameter": "1 mm"})
    ),
    "arms of one sign": lambda: antagonist_pair(
        "nylon", "nylon", supply=SUPPLY, flexor_arm=ARM, extensor_arm=ARM, inertia=1e-3
    ),
    "arms crossed": lambda: antagonist_pair(
        "nylon", "nylon", supply=SUPPLY, flexor_arm=BACK, extensor_arm=ARM, inertia=1e-3
    ),
    "a law without volume": lambda: single_muscle(unit_from_specimen("nylon").replace(law=SPRING), PLATE, supply=SUPPLY),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_built_is_refused_in_a_line(what):
    with pytest.raises(InputError) as error:
        REFUSED[what]()
    assert "\n" not in str(error.value)


def test_a_machine_says_which_signal_or_pressure_is_missing():
    machine = single_muscle("nylon", Body(held=("m",), start=0.14, mass=1.0, signal="push"), supply=SUPPLY)
    shut = {name: Value(jnp.zeros(()), jnp.zeros(())) for name in machine.signals()}
    full = dict.fromkeys(machine.circuit.chambers, 2e5)
    with pytest.raises(InputError, match="signal push"):
        machine.initial(full, {n: v for n, v in shut.items() if n != "push"})
    with pytest.raises(InputError, match="pressure of m is missing"):
        machine.initial({"m.port": 2e5}, shut)
    for bad in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="above 0 Pa"):
            machine.initial(full | {"m": bad}, shut)


def test_a_muscle_without_its_node_is_refused():
    unit = unit_from_specimen("nylon")
    circuit = circuit_for({"other": unit}, supply=SUPPLY)
    with pytest.raises(InputError, match=r"m\.length"):
        Machine.of(circuit, {"m": unit}, PLATE)


def test_law_and_room_of_a_muscle_stand_once_among_the_parameters_so_that_no_address_does_nothing():
    machine = single_muscle("nylon", PlateLoad(held=("m",), span=0.14), supply=6e5)
    known = [path for path, _ in paths.parameters(machine)]
    assert {p for p in known if p.startswith("circuit.nodes.m.") and ".port" not in p and ".heat" not in p} == {
        "circuit.nodes.m.dead_volume"
    }
    assert [p for p in known if p.endswith("rest_length")] == ["units.m.law.rest_length"]
    longer = paths.put(machine, {"units.m.law.rest_volume": 2.0 * machine.units["m"].law.rest_volume})
    volumes = [m.joined.nodes["m"].volume_state(5e5, 0.13, 0.0).value for m in (machine, longer)]
    assert volumes[1] > 1.1 * volumes[0]  # of a tube of 5.6 cm3 beside a braid of 8 cm3


def test_every_parameter_of_a_machine_has_an_address_though_names_have_dots():
    machine = single_muscle("nylon", PlateLoad(held=("m",), span=0.14), supply=6e5)
    known = dict(paths.parameters(machine))
    assert "circuit.nodes.m.port.volume" in known and "circuit.elements.m.tube.length" in known
    for path in known:
        value = np.asarray(paths.get(machine, path))
        assert np.array_equal(np.asarray(paths.get(paths.put(machine, {path: value}), path)), value)
    longer = paths.put(machine, {"circuit.elements.m.tube.length": 2.0})
    assert float(longer.circuit.elements["m.tube"].length) == 2.0
    assert float(machine.circuit.elements["m.tube"].length) != 2.0


def test_a_machine_at_a_moment_has_the_energies_and_powers_of_its_parts():
    """Without a compilation: at a velocity of the load, with the valve shut and open, against the parts' own formulas."""
    load = Body(
        held=("m",), start=0.13, mass=2.0, weight=15.0, stiffness=300.0, spring_rest=0.125, damping=4.0, signal="push"
    )
    machine = single_muscle(unit_from_specimen("nylon", rubs=False, tendon=rig_cord()), load, supply=SUPPLY)
    unit, speed = machine.units["m"], 0.3
    inputs = {n: Value(jnp.asarray(v), jnp.zeros(())) for n, v in (("m.fill", 0.0), ("m.vent", 0.0), ("push", 7.0))}
    still, memory = machine.initial(dict.fromkeys(machine.circuit.chambers, 3e5), inputs)
    moving = still | {"load": still["load"]._replace(velocity=jnp.asarray(speed))}
    shown = {k: float(v) for k, v in machine.outputs(moving, memory, inputs).items()}
    tension, length = shown["m.tension"], shown["m.length"]
    rest, fast = (machine.stored_energies(one, memory, inputs) for one in (still, moving))
    kinetic = 0.5 * 2.0 * speed**2
    assert float(fast["mechanics"] - rest["mechanics"]) == pytest.approx(kinetic, rel=1e-12)
    cord, spring = float(unit.tendon.stored_energy(0.13 - length)), 0.5 * 300.0 * 0.005**2
    assert float(rest["mechanics"]) == pytest.approx(cord + spring - 15.0 * 0.13, rel=1e-9)
    assert float(fast["gas"]) == float(rest["gas"])
    gas = sum(float(machine.joined.nodes[n].volume_state(3e5, length, 0.0).value) for n in machine.circuit.chambers)
    inner = sum(float(machine.joined.inner_volume(n)) for n in machine.circuit.chambers)
    assert float(rest["gas"]) == pytest.approx(3e5 * (gas + inner) / 0.4, rel=1e-9)
    # at rest the braid and its cord pull alike; nothing moves but the load, which its damper and the outside act on
    pull = float(machine.outputs(still, memory, inputs)["m.tension"])
    assert pull == pytest.approx(float(unit.tendon.force(0.13 - length)), rel=1e-6) and tension > pull  # its loss
    rate = machine.rate(moving, memory, inputs)["load"]
    assert float(rate.position) == speed
    assert float(rate.velocity) == pytest.approx((15.0 + 7.0 - 300.0 * 0.005 - 4.0 * speed - tension) / 2.0, rel=1e-9)
    powers = machine.integrands(moving, memory, inputs)
    assert float(powers["outside"]) == pytest.approx(7.0 * speed, rel=1e-12)
    assert float(powers["outside_turnover"]) == abs(float(powers["outside"]))
    assert float(powers["delivered"]) == pytest.approx(-tension * speed, rel=1e-9)
    assert float(powers["m.slack"]) == 0.0 and machine.slackness(powers) == (powers["m.slack"],)
    balances = machine.balances(powers)
    assert set(balances) == {"gas", "mechanics"} and balances["mechanics"].turnover is powers["exchanged"]
    assert float(machine.gauge(moving, "m")) == pytest.approx(3e5 - 101325.0, rel=1e-12)
    # shut, the gas keeps its mass; filling it gains, and venting it loses
    for name, sign in ((None, 0), ("m.fill", 1), ("m.vent", -1)):
        now = inputs | ({name: Value(jnp.ones(()), jnp.zeros(()))} if name else {})
        flow = sum(float(v) for v in machine.rate(still, memory, now)["circuit"]["mass"].values())
        assert np.sign(flow) == sign


def test_an_output_means_what_its_last_name_says_of_its_owner():
    for last, (unit, meaning) in OUTPUTS.items():
        assert output_meaning(f"left.arm.{last}") == (unit, f"{meaning}, left.arm")
    assert output_meaning("pump.oil_level") == ("1", "oil level, pump")
