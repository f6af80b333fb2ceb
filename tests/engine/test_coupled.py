"""Machines of many muscles that share a tank, a joint or a body: evaluated as arrays, with the numbers of one long step."""

import numpy as np
import pytest

from mckibben.assembly import machine as machine_module
from mckibben.assembly.build import AirLine, rig_cord, several, unit_from_specimen
from mckibben.assembly.loads import Body, ChainLink, JointLoad, LinkChain, MomentArm, PlateLoad
from mckibben.engine import held
from mckibben.engine.coupled import CellGroup, CoupledRun
from mckibben.engine.integration import compile_march
from mckibben.engine.native import EngineFunction
from mckibben.engine.signals import Value
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.tubes import InertialTube
from mckibben.pneumatics.volume import FixedVolume

ROOM, SAMPLES, MUSCLES = 101325.0, 40, 16
NAMES = [f"m{k}" for k in range(MUSCLES)]
TANK = {"tank": FixedVolume(volume=2e-4), "feed": Orifice(conductance=2e-7)}
ARMS = {n: MomentArm(coefficients=np.array([0.02, 0.001]) * (1 - 2 * (k % 2)), span=0.14) for k, n in enumerate(NAMES)}
LINK = {"length": 0.2, "mass": 0.3, "centre": 0.1, "inertia": 1e-3}
LOADS = {
    "plate": PlateLoad(held=tuple(NAMES), span=0.14),
    "joint": JointLoad(arms=ARMS, inertia=0.01),
    "body": Body(held=tuple(NAMES), start=0.14, mass=1.0, weight=5.0),
    "chain": LinkChain(
        links={"a": ChainLink(**LINK), "b": ChainLink(**LINK)},
        arms={n: {"a": arm, "b": arm} if k % 3 else {"a": arm} for k, (n, arm) in enumerate(ARMS.items())},
        order=("a", "b"),
        gravity=9.81,
    ),
}


def rig(load="plate", **more):
    """Muscles of their own masses and tubes, filled at different times; (machine, state and memory, signals)."""
    units = {
        n: unit_from_specimen("nylon", tendon=rig_cord(), end_mass=0.02 * (1.0 + 0.1 * k)) for k, n in enumerate(NAMES)
    }
    tubes = [InertialTube(viscous=54.0, turbulent=6.4, area=7.9e-6, length=0.5 + 0.1 * k) for k in range(MUSCLES)]
    lines = {n: AirLine(tube=tube) for n, tube in zip(NAMES, tubes, strict=True)}
    machine = several(units, LOADS[load], supply=5e5, line=lines, **more)
    time = np.arange(SAMPLES + 1)
    signals = {f"{n}.fill": held(np.where(time >= k % 5, 1.0, 0.0)) for k, n in enumerate(NAMES)}
    signals |= {f"{n}.vent": held(np.zeros(SAMPLES + 1)) for n in NAMES}
    return machine, started(machine, signals), signals


def started(machine, signals):
    values = {n: Value(np.asarray(s.values[0]), np.zeros(())) for n, s in signals.items()}
    return machine.initial(dict.fromkeys(machine.circuit.chambers, ROOM), values)


def compiled(machine, start, signals, **more):
    return compile_march(machine, *start, signals, period=1e-3, inner=5, engine="native", **more)


@pytest.mark.slow  # the long step takes ten seconds to compile
@pytest.mark.parametrize(("load", "more"), [("joint", TANK), ("body", {}), ("chain", {})])
def test_muscles_that_share_move_as_in_one_long_step(load, more, monkeypatch):
    machine, start, signals = rig(load, **more)
    arrays = compiled(machine, start, signals)
    found = arrays(machine, *start, signals)
    monkeypatch.setattr(machine_module, "MANY_COUPLED", MUSCLES + 1)
    long_start = started(machine, signals)
    long = compiled(machine, long_start, signals)
    want = long(machine, *long_start, signals)
    assert (type(arrays), type(long)) == (CoupledRun, EngineFunction)
    assert set(found) == set(want)
    for name, values in want.items():
        # 200 steps of rounding, and sums of 16 in another order; of a channel its largest value counts
        np.testing.assert_allclose(
            found[name], values, rtol=0.0, atol=1e-11 * (np.abs(values).max() + 1e-30), err_msg=name
        )


def filled(count, tank):
    """Equal muscles on one tank, filled together: outputs."""
    names = NAMES[:count]
    units = dict.fromkeys(names, unit_from_specimen("nylon"))
    line = AirLine(tube=InertialTube(viscous=54.0, turbulent=6.4, area=7.9e-6, length=0.5))
    load = PlateLoad(held=tuple(names), span=0.14)
    machine = several(units, load, supply=5e5, line=dict.fromkeys(names, line), **tank)
    signals = {
        f"{n}.{way}": held(np.full(SAMPLES + 1, way == "fill", float)) for n in names for way in ("fill", "vent")
    }
    start = started(machine, signals)
    run = compiled(machine, start, signals)
    return type(run), run(machine, *start, signals)


def test_muscles_on_one_tank_are_as_many_single_ones_on_their_shares_of_it():
    kind, together = filled(MUSCLES, TANK)
    share = {"tank": FixedVolume(volume=2e-4 / MUSCLES), "feed": Orifice(conductance=2e-7 / MUSCLES)}
    other, single = filled(1, share)
    assert (kind, other) == (CoupledRun, EngineFunction)
    assert np.ptp(single["m0.pressure"]) > 1e5
    for name in ("m0.pressure", "m0.length", "m0.tension", "m0.mass", "tank.pressure_abs", "tank.temperature"):
        for twin in [name.replace("m0", n) for n in NAMES] if name.startswith("m0") else [name]:
            # 200 steps of rounding, of sums of 16 and of a program whose products are regrouped otherwise
            np.testing.assert_allclose(together[twin], single[name], rtol=1e-11, err_msg=twin)


@pytest.fixture(scope="module")
def tank():
    """Muscles on one tank behind an orifice: machine, start, signals, and their compiled run."""
    machine, start, signals = rig(**TANK)
    return machine, start, signals, compiled(machine, start, signals)


def test_the_gas_that_enters_a_tank_is_in_the_tank_and_its_muscles(tank):
    machine, start, signals, run = tank
    out = run(machine, *start, signals)
    stored = sum(out[f"{name}.mass"] for name in machine.circuit.chambers)
    entered = out["feed.mass_flow"]
    # by the trapezoidal rule over samples of 1 ms, whose error is that of a flow which falls by a few percent
    by_rule = np.concatenate([[0.0], np.cumsum(0.5e-3 * (entered[1:] + entered[:-1]))])
    assert by_rule[-1] > 1e-5
    np.testing.assert_allclose(stored - stored[0], by_rule, rtol=0.0, atol=2e-3 * by_rule[-1])


def test_the_gas_of_a_closed_tank_and_its_muscles_stays(tank):
    machine, start, signals, run = tank
    elements = dict(machine.circuit.elements)
    elements["feed"] = elements["feed"].replace(conductance=0.0)
    closed = machine.replace(circuit=machine.circuit.replace(elements=elements))
    state, memory = start
    gas = dict(state["circuit"])
    gas["mass"], gas["pressure"] = ({**gas[kind], "tank": 5.0 * gas[kind]["tank"]} for kind in ("mass", "pressure"))
    out = run(closed, {**state, "circuit": gas}, memory, signals)
    stored = sum(out[f"{name}.mass"] for name in machine.circuit.chambers)
    assert np.ptp(out["tank.mass"]) > 1e-5  # it fills the muscles
    np.testing.assert_allclose(stored, stored[0], rtol=1e-13)  # sums of 49 masses over 200 steps


def test_a_muscle_of_other_numbers_moves_otherwise_and_the_others_hardly(tank):
    machine, start, signals, run = tank
    before = run(machine, *start, signals)
    units = {**machine.units, "m0": machine.units["m0"].replace(viscosity=5.0)}
    after = run(machine.replace(units=units), *start, signals)
    changed = {name: np.abs(after[name] - before[name]).max() for name in before if name.endswith(".velocity")}
    # its own motion changes at once, that of the others by what it then draws from the tank
    assert max(changed, key=changed.__getitem__) == "m0.velocity"
    assert sorted(changed.values())[-2] < 1e-3 * changed["m0.velocity"]


def test_outputs_that_are_asked_for_are_those_of_all(tank):
    machine, start, signals, run = tank
    names = ["m3.length", "tank.pressure_abs", "m15.tube.mass_flow", "supply.pressure_abs"]
    some = compiled(machine, start, signals, outputs=names)(machine, *start, signals)
    everything = run(machine, *start, signals)
    assert list(some) == names
    for name in names:
        # another program, whose products are regrouped otherwise
        np.testing.assert_allclose(some[name], everything[name], rtol=1e-12, atol=1e-15)


def test_few_muscles_and_muscles_joined_by_a_tube_are_one_step():
    machine, *_ = rig(**TANK)
    assert machine.coupling() is not None
    assert (
        several(
            {n: machine.units[n] for n in NAMES[:3]}, PlateLoad(held=tuple(NAMES[:3]), span=0.14), supply=5e5
        ).coupling()
        is None
    )
    circuit = machine.circuit
    tube = circuit.elements["m0.tube"]
    bridged = circuit.replace(
        elements={**circuit.elements, "bridge": tube}, ends={**circuit.ends, "bridge": (("m0", "m1"), None)}
    )
    assert machine.replace(circuit=bridged).coupling() is None


def test_each_muscle_has_the_parts_of_its_line_once_and_the_core_what_all_share():
    """By names alone, without a compilation: cells and core are all of the machine, and no two have the same part."""
    machine, (state, memory), signals = rig("chain", **TANK)
    coupling = machine.coupling()
    cells, core = coupling.cells(machine, state, memory, signals), coupling.core(machine, state, memory, signals)
    assert len(cells) == MUSCLES
    elements = [set(cell.outputs.values()) & set(machine.circuit.elements) for cell in cells]
    chambers = [set(cell.outputs.values()) & set(machine.circuit.chambers) for cell in cells]
    shared = core.system.circuit
    for parts, left, whole in (
        (elements, set(shared.elements), set(machine.circuit.elements)),
        (chambers, set(shared.chambers), set(machine.circuit.chambers)),
    ):
        assert sum(map(len, parts)) + len(left) == len(whole) and set().union(*parts, left) == whole
    assert set(shared.elements) == {"feed"} and set(shared.chambers) == {"tank"}
    for name, cell, mine in zip(NAMES, cells, elements, strict=True):
        assert all(element.startswith(f"{name}.") for element in mine) and len(mine) == len(elements[0])
        ends = {new: cell.system.circuit.ends[new] for new in cell.system.circuit.elements}
        assert len(ends) == len(mine)
        part_state, part_memory = cell.state, cell.memory
        for new, old in cell.outputs.items():
            for kind, values in part_state["circuit"].items():
                assert (new in values) == (old in state["circuit"][kind])
                assert new not in values or values[new] is state["circuit"][kind][old]
        assert len(part_memory["muscles"]) == len(part_state["muscles"]) == 1
        assert [*cell.system.units.values()][0] is machine.units[name]


def test_a_cell_counts_once_and_one_that_fills_up_not_at_all():
    assert CellGroup(None, np.zeros((3, 8), int), [{}] * 5).weights.tolist() == [1.0] * 5 + [0.0] * 3
