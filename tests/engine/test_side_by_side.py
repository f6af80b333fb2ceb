"""Machines of many independent muscles: integrated side by side, with the numbers of the machine as one long step."""

import numpy as np
import pytest

from mckibben.assembly import machine as machine_module
from mckibben.assembly.build import AirLine, rig_cord, several, unit_from_specimen
from mckibben.assembly.loads import JointLoad, MomentArm, PlateLoad
from mckibben.engine import held
from mckibben.engine.integration import compile_march
from mckibben.engine.native import EngineFunction
from mckibben.engine.side_by_side import SideBySide
from mckibben.engine.signals import Value
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.tubes import InertialTube
from mckibben.pneumatics.volume import FixedVolume

ROOM, SAMPLES, MUSCLES = 101325.0, 12, 16


def rig(count=MUSCLES, load=None, **more):
    """Muscles of their own masses and tubes on one supply, filled at different times; (machine, pressures, signals)."""
    names = [f"m{k}" for k in range(count)]
    units = {
        n: unit_from_specimen("nylon", tendon=rig_cord(), end_mass=0.02 * (1.0 + 0.1 * k)) for k, n in enumerate(names)
    }
    tubes = [InertialTube(viscous=54.0, turbulent=6.4, area=7.9e-6, length=0.5 + 0.1 * k) for k in range(count)]
    lines = {n: AirLine(tube=tube) for n, tube in zip(names, tubes, strict=True)}
    machine = several(units, load or PlateLoad(held=tuple(names), span=0.14), supply=5e5, line=lines, **more)
    time = np.arange(SAMPLES + 1)
    signals = {f"{n}.fill": held(np.where(time >= k % 5, 1.0, 0.0)) for k, n in enumerate(names)}
    signals |= {f"{n}.vent": held(np.zeros(SAMPLES + 1)) for n in names}
    return machine, dict.fromkeys(machine.circuit.chambers, ROOM), signals


def started(machine, pressures, signals):
    return machine.initial(pressures, {n: Value(np.asarray(s.values[0]), np.zeros(())) for n, s in signals.items()})


@pytest.mark.slow
@pytest.mark.parametrize("outputs", [None, ["m3.length", "m0.pressure", "m15.tube.mass_flow", "supply.pressure_abs"]])
def test_muscles_side_by_side_move_as_in_one_long_step(outputs, monkeypatch):
    machine, pressures, signals = rig()
    options = {"period": 1e-3, "inner": 5, "outputs": outputs, "engine": "native"}
    start = started(machine, pressures, signals)
    apart = compile_march(machine, *start, signals, **options)
    found = apart(machine, *start, signals)
    for fewest in ("MANY", "MANY_COUPLED"):  # they share a supply: else they would go as a coupled run
        monkeypatch.setattr(machine_module, fewest, MUSCLES + 1)
    whole_start = started(machine, pressures, signals)
    whole = compile_march(machine, *whole_start, signals, **options)
    want = whole(machine, *whole_start, signals)
    assert (type(apart), type(whole)) == (SideBySide, EngineFunction)
    assert set(found) == set(want)
    for name, values in want.items():
        # 60 steps of rounding; of a channel its largest value counts
        np.testing.assert_allclose(
            found[name], values, rtol=0.0, atol=1e-11 * (np.abs(values).max() + 1e-30), err_msg=name
        )


def test_a_change_of_one_muscle_changes_its_channels_only():
    machine, pressures, signals = rig()
    start = started(machine, pressures, signals)
    run = compile_march(machine, *start, signals, period=1e-3, inner=5, engine="native")
    before = run(machine, *start, signals)
    units = dict(machine.units)
    units["m3"] = units["m3"].replace(viscosity=5.0)
    after = run(machine.replace(units=units), *start, signals)
    changed = {name.split(".")[0] for name in before if not np.array_equal(before[name], after[name])}
    assert changed == {"m3"}


def test_muscles_that_act_on_each_other_stay_together():
    tank = {"tank": FixedVolume(volume=1e-4), "feed": Orifice(conductance=4e-9)}
    machine, *_ = rig(**tank)
    assert machine.names_by_part() == {}
    arms = {f"m{k}": MomentArm(coefficients=np.array([0.02 if k % 2 else -0.02]), span=0.14) for k in range(MUSCLES)}
    machine, *_ = rig(load=JointLoad(arms=arms, inertia=0.01))
    assert machine.names_by_part() == {}
    few, *_ = rig(count=3)
    assert few.names_by_part() == {}
