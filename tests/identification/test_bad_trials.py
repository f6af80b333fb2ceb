"""What cannot be compared with a circuit is refused before anything runs, in one line that names it and what is allowed."""

import re
from dataclasses import replace

import numpy as np
import pytest

from mckibben.assembly.circuit_file import read_circuit
from mckibben.engine import held, ramped
from mckibben.errors import ConvergenceError, InputError
from mckibben.identification import Trial, fit_circuit
from mckibben.identification.trial import trial_from_record
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.tubes import LinearTube
from mckibben.pneumatics.volume import FixedVolume, Isothermal, Reservoir
from mckibben.recordings import Channel, Recording

N = 20
PERIOD = 1e-3
FREE = "elements.tube.resistance"
TEXT = """
schema = 1
[nodes.supply]
kind = "reservoir"
signal = "wish"
[nodes.tank]
kind = "volume"
volume = "50 ml"
[nodes.room]
kind = "atmosphere"
[elements.valve]
kind = "spool_valve"
supply = "supply"
work = "tank"
exhaust = "room"
conductance = "1e-8 m^3/(s*Pa)"
lag = "2 ms"
dead_time = "1 ms"
command = "open"
[signals.open]
kind = "constant"
value = 1
[signals.wish]
kind = "constant"
value = "5 bar"
[run]
duration = "20 ms"
"""


def circuit(tube: str = "tube") -> Circuit:
    nodes = {"p": Reservoir(signal="p"), "tank": FixedVolume(volume=5e-5, heat=Isothermal())}
    return Circuit.of(nodes, {tube: Branch(LinearTube(resistance=1e8), ("p", "tank"))})


def trial(name: str = "one", **changes) -> Trial:
    rise = np.linspace(1e5, 3e5, N)
    given = {
        "circuit": circuit(),
        "signals": {"p": ramped(rise)},
        "initial": {"tank": 1e5},
        "measured": {"tank.pressure_abs": rise},
        "period": PERIOD,
    }
    return Trial(name=name, **{**given, **changes})


def refusal(act, *says: str, kind=InputError) -> str:
    with pytest.raises(kind) as refused:
        act()
    said = str(refused.value)
    assert "\n" not in said
    for words in says:
        assert words in said, said
    return said


def bent(**changes):
    return lambda: trial("bent", **changes)


def test_a_trial_refuses_what_is_no_record() -> None:
    rise = np.linspace(1e5, 3e5, N)
    refusal(bent(measured={}), "bent", "at least one recorded channel")
    refusal(bent(measured={"tank.pressure_abs": rise[:-1]}), "bent", "need one length", "[19, 20]")
    for bad in (np.nan, np.inf):
        refusal(bent(measured={"tank.pressure_abs": np.where(rise > 2e5, bad, rise)}), "bent", "finite")
        refusal(bent(signals={"p": held(np.where(rise > 2e5, bad, rise))}), "bent: p ", "finite")
    refusal(bent(measured={"tank.pressure_abs": rise - 1.5e5}), "tank.pressure_abs", "-50000", "below vacuum")
    refusal(bent(initial={"tnak": 1e5}), "bent: initial.tank must be", "above 0 Pa")
    for none in (0.0, -1.0, np.nan):
        refusal(bent(initial={"tank": none}), "bent: initial.tank", "above 0 Pa")
        refusal(bent(period=none), "bent: period", "above 0 s")
        refusal(bent(temperature=none), "bent: temperature", "above 0 K")
    refusal(bent(signals={"q": held(rise)}), "bent: signals is 'p'", "the trial has q")


@pytest.mark.parametrize(
    ("free", "start", "says"),
    [
        ([], {}, "at least one parameter"),
        (["elements.tube.resistence"], {}, "Known are elements.tube.resistance"),
        (["elements.tub*.lenght"], {}, "elements.tub*.lenght"),
        (["signals.pp.delay"], {}, "Known are signals.p.delay"),
        ([FREE, "elements.*.resistance"], {}, "is free already, by elements.tube.resistance"),
        (["*"], {}, "one value cannot be"),
        ([FREE], {"nodes.tank.volume": 1e-4}, f"it is not free; free are {FREE}"),
        ([FREE], {FREE: -1.0}, "must be"),
        ([FREE], {FREE: float("nan")}, "must be"),
        (["signals.p.delay"], {"signals.p.delay": 2.0}, "must be"),
    ],
)
def test_a_fit_refuses_parameters_that_are_not_there_or_not_free(free, start, says) -> None:
    refusal(lambda: fit_circuit([trial()], free, start=start), says)


def test_a_fit_refuses_records_that_do_not_go_together() -> None:
    refusal(lambda: fit_circuit([], [FREE]), "at least one record")
    refusal(lambda: fit_circuit([trial(), trial()], [FREE]), "one", "twice")
    refusal(lambda: fit_circuit([trial()], [FREE], predict=[trial()]), "one", "twice")
    other = trial("other", circuit=circuit("hose"))
    refusal(lambda: fit_circuit([trial(), other], [FREE]), "elements.tube.resistance", "elements.hose.resistance")
    refusal(lambda: fit_circuit([trial()], ["elements.*.resistance"], predict=[other]), "other: ", "in one")
    unknown = trial(measured={"tnak.pressure_abs": np.linspace(1e5, 3e5, N)})
    refusal(lambda: fit_circuit([unknown], [FREE]), "tnak.pressure_abs", "tank.pressure_abs")
    late = trial("late", measured={"tnak.pressure_abs": np.linspace(1e5, 3e5, N)})
    refusal(lambda: fit_circuit([trial()], [FREE], predict=[late]), "late: ", "tnak.pressure_abs")
    refusal(lambda: fit_circuit([trial()], [FREE], evaluations=0), "evaluations", "from 1")


def test_a_start_from_which_nothing_runs_is_said() -> None:
    """Half a second is no step for a tank that follows in 6 us, not even a 256th part of it."""
    slow = trial(period=1.0)
    refusal(
        lambda: fit_circuit([slow], [FREE], start={FREE: 1e4}, step=0.5), "one: ", "too fast", kind=ConvergenceError
    )


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "circuit.toml"
    path.write_text(TEXT)
    return read_circuit(path)


def recording(**units: str) -> Recording:
    """Channels `a__b` of a rise with a unit, as ``a.b``."""
    rise = np.linspace(1e5, 3e5, N)
    channels = {n.replace("__", "."): Channel(rise / rise[-1] if u == "1" else rise, u) for n, u in units.items()}
    return Recording(PERIOD * np.arange(N), channels)


def test_a_record_finds_its_places_by_name(plan) -> None:
    found = trial_from_record(plan, recording(tank__pressure="Pa", supply__pressure="Pa", valve__command="1"), name="r")
    rise = np.linspace(1e5, 3e5, N)
    assert found.channels == ("tank.pressure_abs",)
    np.testing.assert_allclose(found.measured["tank.pressure_abs"], rise + 101325.0, rtol=1e-14)
    np.testing.assert_allclose(found.signals["supply.pressure"].values, rise + 101325.0, rtol=1e-14)
    np.testing.assert_allclose(found.signals["open"].values, rise / rise[-1], rtol=1e-14)
    assert found.initial == {"tank": pytest.approx(201325.0, rel=1e-14)}
    # the dead time stays a parameter: its late command is made anew with every value of it
    assert "valve.command" not in found.signals
    assert found.inputs == ("open", "wish")
    moved = found.with_parameters({"signals.wish.delay": 2e-3, "elements.valve.dead_time": 3e-3})[1]
    assert {n: float(s.delay) for n, s in moved.items() if s.delay is not None} == {
        "wish": 2e-3,
        "supply.pressure": 2e-3,
        "valve.command": 3e-3,
    }
    bare = trial_from_record(plan, recording(tank__pressure_abs="Pa"), name="r")
    np.testing.assert_allclose(bare.signals["wish"].values, 5e5)
    assert bare.initial == {"tank": pytest.approx(1e5)}


@pytest.mark.parametrize(
    ("units", "options", "says"),
    [
        ({"tnak__pressure": "Pa"}, {}, ("No channel of the record can be compared", "tank.pressure", "tnak.pressure")),
        ({"supply__pressure": "Pa"}, {}, ("No channel of the record can be compared",)),
        ({"tank__pressure": "V"}, {}, ("tank.pressure", "got V", "must be values in Pa")),
        ({"tank__pressure": "Pa", "open": "V"}, {}, ("open", "got V", "values in 1")),
        ({"tank__pressure": "Pa", "valve__command": "Pa"}, {}, ("valve.command", "values in 1")),
        ({"p1": "Pa"}, {"measured": {"tank": "p2"}}, ("p2", "The record has p1")),
        ({"p1": "Pa"}, {"measured": {"tnak": "p1"}}, ("No channel", "tank")),
        ({"tank__pressure": "Pa", "u": "1"}, {"inputs": {"opne": "u"}}, ("opne", "Signals are open, wish")),
        (
            {"tank__pressure": "Pa", "u": "V"},
            {"inputs": {"open": "u"}},
            ("u must be values in 1, got V", "values in 1"),
        ),
    ],
)
def test_a_record_that_does_not_fit_the_circuit_is_refused(plan, units, options, says) -> None:
    said = refusal(lambda: trial_from_record(plan, recording(**units), name="bad.csv", **options), *says)
    assert re.match(r"bad\.csv: ", said)


def test_a_record_below_vacuum_is_refused(plan) -> None:
    below = recording(tank__pressure_abs="Pa")
    below = replace(below, channels={"tank.pressure_abs": Channel(below["tank.pressure_abs"] - 1.2e5)})
    refusal(lambda: trial_from_record(plan, below, name="bad.csv"), "bad.csv: tank.pressure_abs", "below vacuum")
