"""Machines of many independent muscles: integrated side by side, with the numbers of the machine as one long step."""

from typing import Any, NamedTuple

import jax
import numpy as np
import pytest

from mckibben.assembly import machine as machine_module
from mckibben.assembly.build import AirLine, rig_cord, several, unit_from_specimen
from mckibben.assembly.loads import JointLoad, MomentArm, PlateLoad
from mckibben.engine import held
from mckibben.engine.integration import compile_march
from mckibben.engine.native import EngineFunction
from mckibben.engine.side_by_side import SideBySide, Split, find_places, known_prefix
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


def test_the_longest_known_beginning_of_a_dotted_name_is_found_and_none_of_an_unknown_one():
    for name, known, found in (
        ("a.b.c", {"a.b.c", "a"}, "a.b.c"),
        ("a.b.c", {"a", "a.b"}, "a.b"),
        ("a.b.c", {"a", "b", "b.c"}, "a"),
        ("ab.c", {"a"}, None),
        ("a", {"a.b"}, None),
    ):
        assert known_prefix(name, known) == found


def test_numbers_that_are_taken_have_their_places_and_what_is_computed_has_none():
    trees = {"a": 1.0, "b": [2.0, 3.0]}, 4.0
    assert find_places(lambda table, last: [last, table["b"][1], table["a"], last], trees) == [3, 2, 0, 3]
    assert find_places(lambda table, last: [table["b"][0] + 0.0 * last, last], trees) == [-1, 3]
    assert find_places(lambda table, last: [5.0, table["a"]], trees) == [-1, 0]


class Parts(NamedTuple):
    """What a system says of one of its parts."""

    system: Any
    state: Any
    memory: Any
    signals: Any
    outputs: dict[str, str]


@jax.tree_util.register_static
class Row:
    """A system without numbers of its own, and what it says of its parts."""

    def __init__(self, parts):
        self.parts = parts


def test_a_system_splits_into_parts_of_one_structure_and_what_they_share_is_one_number():
    def parts(state, memory, signals):
        return [Parts(memory, state[k], {}, signals, {"x": f"part{k}.x"}) for k in range(2)]

    rest = [1.0, 2.0, 3.0], 7.0, {"u": 8.0}
    split = Split.of((Row(parts), *rest))
    assert split.outputs == [{"x": "part0.x"}, {"x": "part1.x"}] and split.example == (7.0, 1.0, {}, {"u": 8.0})
    shared, own, signal = split.stacked([1.0, 2.0, 3.0, 7.0, 8.0])
    assert (float(shared), float(signal), own.tolist()) == (7.0, 8.0, [1.0, 2.0])
    for others in (
        lambda *_: [],
        lambda state, memory, signals: [*parts(state, memory, signals), Parts(memory, 2.0 * state[2], {}, signals, {})],
        lambda state, memory, signals: [*parts(state, memory, signals), Parts(memory, state[2], {}, [signals], {})],
    ):
        assert Split.of((Row(others), *rest)) is None


def test_a_number_that_parts_do_not_share_is_a_column_of_its_own_type():
    values = [np.float64(1.0), np.arange(2.0), np.int32(3), np.int32(4), np.ones(2)]
    single = np.array([1.0, np.nan, 3.0, 4.0, np.nan])

    def stacked(*row):
        return Split._stacked(np.array(row), values, single)

    assert stacked(1, 1) is values[1]
    assert stacked(2, 3).dtype == np.int32 and stacked(2, 3).tolist() == [3, 4]
    assert stacked(0, 2).tolist() == [1.0, 3.0]
    assert stacked(1, 4).tolist() == [[0.0, 1.0], [1.0, 1.0]]
