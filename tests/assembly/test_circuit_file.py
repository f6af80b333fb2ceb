"""From a file to a run: what is read is what runs, bad files are refused by dotted path, and nothing is lost on the way."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

import mckibben as mk
from mckibben.assembly.circuit_file import read_circuit
from mckibben.assembly.circuit_parts import ElementTable
from mckibben.assembly.sentence import run_sentence, sentence
from mckibben.bench import circuit_run
from mckibben.bench.circuit_run import run_circuit
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.experiments.waveforms import Sine
from mckibben.pneumatics.build import ELEMENTS, known_keys
from mckibben.schema import Place, read_table

ROOM = 101325.0
TANK = """
schema = 1
title = "Tank"

[nodes.supply]
kind = "reservoir"
pressure = "5 bar"

[nodes.room]
kind = "atmosphere"

[nodes.tank]
kind = "volume"
volume = "50 ml"

[elements.fill]
kind = "spool_valve"
supply = "supply"
work = "tank"
exhaust = "room"
conductance = "1e-8 m^3/(s*Pa)"
lag = "2 ms"
dead_time = "1.4 ms"
command = "open"

[signals.open]
kind = "pulse"
start = "10 ms"
width = "60 ms"
high = 1
low = -0.4

[run]
duration = "0.15 s"
"""
MUSCLE = """
schema = 1
[environment]
pressure_abs = "1.0336 bar"
temperature = "300 K"
[nodes.source]
kind = "reservoir"
signal = "wish"
[nodes.joint]
kind = "junction"
[nodes.muscle]
kind = "muscle"
specimen = "nylon"
signal = "length"
start_pressure = "2 bar"
[elements.first]
kind = "lumped_tube"
from = "source"
to = "joint"
length = "20 cm"
diameter = "3 mm"
[elements.second]
kind = "orifice"
from = "joint"
to = "muscle"
hole_diameter = "2 mm"
[signals.wish]
kind = "steps"
times = ["0 s", "0.1 s"]
values = ["2 bar", "3 bar"]
[signals.length]
kind = "sine"
mean = "14 cm"
amplitude = "3 mm"
frequency = "5 Hz"
[run]
duration = "0.2 s"
"""


@pytest.fixture
def read(tmp_path):
    def one(text, *changes):
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "circuit.toml"
        path.write_text(text)
        return read_circuit(path)

    return one


def test_what_is_written_is_what_is_built(read):
    plan = read(MUSCLE)
    nodes = plan.circuit.nodes
    assert float(nodes["muscle"].ambient) == pytest.approx(103360.0)
    assert float(nodes["source"].temperature) == 300.0
    assert plan.starts == {"joint": 0.0, "muscle": pytest.approx(2e5)}
    assert plan.samples == 200
    inputs = plan.inputs()
    # a supply's signal is gauge in the file, absolute in the circuit, and jumps; a length never does
    assert np.asarray(inputs["source.pressure"].values)[[0, 99, 100]] == pytest.approx([303360, 303360, 403360])
    assert not inputs["source.pressure"].straight
    assert inputs["muscle.length"].straight
    state, _ = plan.initial()
    assert float(state["pressure"]["muscle"]) == pytest.approx(303360.0)


def test_a_length_is_straight_between_samples_even_where_it_steps(read):
    sine = 'kind = "sine"\nmean = "14 cm"\namplitude = "3 mm"\nfrequency = "5 Hz"'
    plan = read(MUSCLE, (sine, 'kind = "steps"\ntimes = ["0 s", "0.1 s"]\nvalues = ["14 cm", "14.2 cm"]'))
    assert plan.inputs()["muscle.length"].straight
    (signal,) = (one for one in plan.signals.values() if one.unit == "m")
    assert [dataclasses.replace(signal, unit=unit).straight for unit in ("m", "Pa", "1")] == [True, False, False]
    smooth = next(iter(read(MUSCLE).signals.values()))
    smooth = dataclasses.replace(smooth, waveform=Sine(mean=2e5, amplitude=1e4, frequency=5.0))
    assert [dataclasses.replace(smooth, unit=unit).straight for unit in ("m", "Pa", "1")] == [True, True, True]


def test_the_sentence_is_one_line_and_the_same_again(read):
    plan = read(TANK)
    assert sentence(plan) == (
        "supply (5 bar) -> fill (spool valve, conductance 1e-8 m^3/(s*Pa), lag 2 ms, dead time 1.4 ms, "
        "exhaust at room (1.013 bar absolute), driven by open) -> tank (50 cm^3, isothermal)"
    )
    assert run_sentence(plan) == "open: pulse from -0.4 to 1 at 10 ms for 60 ms; for 150 ms at 1 kHz, step 50 us"


def test_a_changed_dimension_is_built_anew_and_a_parameter_without_key_is_replaced(read):
    plan = read(MUSCLE)
    longer = plan.change({"elements.first.length": "40 cm", "elements.first.ends": 3, "gas.gas_constant": 290.0})
    tube = longer.circuit.elements["first"]
    assert float(tube.length) == pytest.approx(0.4)
    assert float(tube.ends) == 3.0
    assert float(longer.circuit.gas.gas_constant) == 290.0
    again = longer.change({"elements.second.hole_diameter": "1 mm", "run.method": "ros2"})
    # a quarter of the area, a quarter of the conductance: what follows from a key follows it
    ratio = again.circuit.elements["second"].conductance / plan.circuit.elements["second"].conductance
    assert float(ratio) == pytest.approx(0.25, rel=1e-12)
    assert float(again.circuit.elements["first"].ends) == 3.0
    assert again.method == "ros2"
    assert "ends 3" in sentence(again)
    assert float(plan.circuit.elements["first"].length) == pytest.approx(0.2)  # the first plan is as it was
    assert float(plan.change({"elements.first.length": 0.3}).circuit.elements["first"].length) == 0.3  # bare is SI
    stiffer = plan.change({"nodes.muscle.parameters.threshold_pressure": "1.2 bar"})
    assert float(stiffer.nodes["muscle"].law.threshold_pressure) == pytest.approx(1.2e5)


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("elements.frist.length", "1 m", "Did you mean 'elements.first.length'"),
        ("elements.first.lenght", "1 m", "Did you mean 'length'"),
        ("elements.first.length", "1 bar", "must be a length"),
        ("elements.first.ends", "-1", "elements.first.ends"),
        ("signals.wish.times.9.x", "1 s", "parameter"),
        ("run.duration", "-1 s", "run.duration"),
        ("nodes.muscle.length", "14 cm", "not both"),
    ],
)
def test_bad_changes_are_refused(read, path, value, says):
    with pytest.raises(InputError) as error:
        read(MUSCLE).change({path: value})
    assert says in str(error.value)


BAD = [
    (TANK, "schema = 1", "schema = 2", "schema must be 1"),
    (TANK, "[run]", "[rum]", "Did you mean 'run'"),
    (TANK, 'kind = "volume"', 'kind = "volum"', "Unknown nodes.tank.kind 'volum'. Did you mean 'volume'"),
    (TANK, 'kind = "spool_valve"', 'kind = "spol_valve"', "Unknown elements.fill.kind 'spol_valve'. Did you mean 'spool"),
    (TANK, 'volume = "50 ml"', 'volume = "0 ml"', "nodes.tank.volume"),
    (TANK, 'volume = "50 ml"', 'volume = "-50 ml"', "nodes.tank.volume"),
    (TANK, 'volume = "50 ml"', 'volume = "50"', "the unit is missing"),
    (TANK, 'volume = "50 ml"', "", "nodes.tank.volume is missing"),
    (TANK, 'volume = "50 ml"', 'volume = "50 ml"\nstart_pressure = "-2 bar"', "above vacuum, -1.013 bar"),
    (TANK, 'volume = "50 ml"', 'volume = "50 ml"\nheat = "adiabtic"', "Did you mean 'adiabatic'"),
    (TANK, 'volume = "50 ml"', 'volume = "50 ml"\nheat = {kind = "wall"}', "nodes.tank.heat.conductance"),
    (TANK, 'pressure = "5 bar"', 'presure = "5 bar"', "Unknown field 'nodes.supply.presure'. Did you mean 'pressure'"),
    (TANK, 'pressure = "5 bar"', 'pressure = "5 bar"\nsignal = "open"', "not both"),
    (TANK, 'work = "tank"', 'work = "tnak"', "Unknown elements.fill.work 'tnak'. Did you mean 'tank'"),
    (TANK, 'work = "tank"', "", "elements.fill.work is missing"),
    (TANK, 'work = "tank"', 'work = "room"', "elements.fill"),
    (TANK, 'work = "tank"', 'work = "tank"\ncritical_ratio = 1.2', "elements.fill.critical_ratio"),
    (TANK, 'work = "tank"', 'work = "tank"\ncritical_ratio = 0', "elements.fill.critical_ratio"),
    (TANK, 'work = "tank"', 'work = "tank"\ncritcal_ratio = 0.3', "Did you mean 'critical_ratio'"),
    (TANK, 'work = "tank"', 'work = "tank"\nspecimen = "nylon"', "elements.fill.specimen"),
    (TANK, 'work = "tank"', 'work = "tank"\nspecimen = "MPP"', "Unknown elements.fill.specimen 'MPP'"),
    (TANK, 'command = "open"', "", "elements.fill.command"),
    (TANK, 'command = "open"', 'command = "opne"', "Unknown elements.fill.command 'opne'. Did you mean 'open'"),
    (TANK, "[run]", '[signals.spare]\nkind = "constant"\nvalue = 1\n[run]', "signals.spare is unused"),
    (TANK, "[run]", '[elements.short]\nkind = "orifice"\nfrom = "supply"\nto = "room"\nhole_diameter = "1 mm"\n[run]',
     "elements.short joins two supplies, supply and room"),
    (TANK, "[run]", '[nodes.far]\nkind = "volume"\nvolume = "1 l"\n[run]', "nodes.far needs at least one element"),
    (TANK, "[run]", '[nodes."a b"]\nkind = "atmosphere"\n[run]', "must be a name"),
    (TANK, 'duration = "0.15 s"', "", "run.duration is missing"),
    (TANK, 'duration = "0.15 s"', 'duration = "0.1504 s"', "whole number of periods"),
    (TANK, 'duration = "0.15 s"', 'duration = "1e6 s"', "20000000 samples"),
    (TANK, 'duration = "0.15 s"', 'duration = "0.15 s"\nmethod = "euler"', "run.method"),
    (TANK, "schema = 1", "schema = ", "not TOML"),
    (MUSCLE, 'kind = "lumped_tube"\nfrom = "source"\nto = "joint"\nlength = "20 cm"\ndiameter = "3 mm"',
     'kind = "orifice"\nfrom = "source"\nto = "joint"\nconductance = "1e-9 m^3/(s*Pa)"',
     "nodes.joint.volume is missing: nothing that joins here gives the junction volume"),
    (MUSCLE, 'specimen = "nylon"', 'specimen = "nylom"', "Did you mean 'nylon'"),
    (MUSCLE, 'specimen = "nylon"', 'specimen = "MPP-3-1-8"', "nodes.muscle"),
    (MUSCLE, 'specimen = "nylon"', 'specimen = "nylon"\nlaw = "sarosi"', "nodes.muscle.law"),
    (MUSCLE, 'mean = "14 cm"', 'mean = "15.3 cm"', "signals.length (the length of muscle)"),
    (MUSCLE, 'frequency = "5 Hz"', 'frequency = "700 Hz"', "run.period"),
    (MUSCLE, 'values = ["2 bar", "3 bar"]', 'values = ["2 bar", "-3 bar"]', "below vacuum"),
    (MUSCLE, 'signal = "length"', 'signal = "wish"', "it cannot be in"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "old", "new", "says"), BAD, ids=[b[3][:50] for b in BAD])
def test_bad_files_are_refused_by_file_and_dotted_path(read, text, old, new, says):
    with pytest.raises(InputError) as error:
        read(text, (old, new))
    assert says in str(error.value)
    assert "circuit.toml" in str(error.value)
    assert "\n" not in str(error.value)


def test_no_file_is_a_clear_complaint(tmp_path):
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(InputError, match="File not found|file must be a TOML file"):
            read_circuit(path)


def test_a_signal_may_come_from_a_measured_table(read, tmp_path):
    rows = "\n".join(f"{0.01 * i:.2f},{2 + 0.05 * i:.3f},{i}" for i in range(21))
    (tmp_path / "step.csv").write_text("time_s,wish_bar,other_N\n" + rows + "\n")
    steps = 'kind = "steps"\ntimes = ["0 s", "0.1 s"]\nvalues = ["2 bar", "3 bar"]'
    plan = read(MUSCLE, (steps, 'kind = "table"\nfile = "step.csv"\ncolumn = "wish_bar"'))
    # straight between rows 10 ms apart
    np.testing.assert_allclose(plan.values()["wish"][[0, 5, 200]], [2e5, 2.025e5, 3e5], rtol=1e-12)
    for column, says in (('\ncolumn = "other_N"', "signals.wish.column"), ("", "name one"), ('\ncolumn = "x"', "x")):
        with pytest.raises(InputError, match=says):
            read(MUSCLE, (steps, 'kind = "table"\nfile = "step.csv"' + column))


def test_a_tank_ends_where_the_gas_law_says(read):
    rec = run_circuit(read(TANK, ('start = "10 ms"\nwidth = "60 ms"', 'width = "1 s"')))
    assert rec["tank.pressure"][-1] == pytest.approx(5e5, rel=1e-6)  # full long before 150 ms
    gained = rec["tank.mass"][-1] - rec["tank.mass"][0]
    assert gained == pytest.approx(5e5 * 50e-6 / (287.05 * 293.15), rel=1e-6)  # dm = V dP/(R T), isothermal
    np.testing.assert_allclose(rec["tank.pressure"], rec["tank.pressure_abs"] - ROOM, atol=1e-6)
    assert rec.meta["balance"]["mass"] < 1e-10  # linear in the flows: rounding
    assert rec.channels["open"].kind == "command"
    assert rec.meta["parameters"]["nodes.tank.volume"] == {"value": pytest.approx(50e-6), "unit": "m^3"}


def test_in_parts_or_whole_a_run_is_the_same_to_rounding(read, monkeypatch):
    # a dead time of 1.4 samples reaches over the border of two parts, as does the lag's state
    plan = read(TANK, ('duration = "0.15 s"', 'duration = "0.15 s"\nmethod = "rk4"'))
    whole = run_circuit(plan)
    monkeypatch.setattr(circuit_run, "CHUNK", 60 * 20)  # 60 samples of 20 steps: the border falls on 60 and 120 ms
    told = []
    assert circuit_run.chunks(plan) == 3
    parts = run_circuit(plan, progress=told.append)
    assert len(told) == 3
    np.testing.assert_array_equal(parts.time, whole.time)
    for name in whole.channels:
        # the programs of the whole and of a part may differ in rounding
        np.testing.assert_allclose(parts[name], whole[name], rtol=1e-11, atol=1e-12 * np.abs(whole[name]).max())
    assert parts.meta["balance"]["mass"] < 1e-10


def test_an_interrupted_run_returns_what_it_has(read, monkeypatch):
    plan = read(TANK)
    monkeypatch.setattr(circuit_run, "CHUNK", 60 * 20)

    def stop(_words):
        raise KeyboardInterrupt

    rec = run_circuit(plan, progress=stop)
    assert rec.meta["result"] == "interrupted"
    assert rec.meta["message"] == "Interrupted after 0.06 s of 0.15 s."
    assert len(rec.time) == 61
    assert rec.meta["balance"]["mass"] < 1e-10


def test_a_moving_muscle_balances_and_shows_its_tension(read):
    rec = run_circuit(read(MUSCLE))
    # second order at the kinks of the supply's step; measured 1e-7 and below
    assert rec.meta["balance"]["energy"] < 1e-6
    assert rec.meta["balance"]["mass"] < 1e-10
    assert rec["muscle.pressure"][-1] == pytest.approx(3e5, rel=0.02)
    assert rec["muscle.tension"].max() > 20.0
    assert rec.unit("muscle.tension") == "N"
    assert "chou1996" in rec.meta["citations"]
    assert rec.meta["environment"]["temperature"] == 300.0


EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "circuits").glob("*.toml"))


def test_there_are_examples():
    assert {"filling-a-tank", "muscle-on-a-valve", "compressor-and-tank"} <= {p.stem for p in EXAMPLES}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_a_circuit_says_each_node_once_and_each_element_with_its_kind(path):
    plan = read_circuit(path)
    said = sentence(plan)
    for name, node in plan.nodes.items():
        assert not node.words or said.count(f"{name} ({node.words})") == 1
    for name, element in plan.document["elements"].items():
        assert said.count(f" -> {name} ({element['kind'].replace('_', ' ')}") == 1


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_examples_run_and_balance(path):
    rec = run_circuit(read_circuit(path).change({"run.duration": "0.5 s"}))
    assert rec.meta["result"] == "done"
    assert rec.meta["balance"]["mass"] < 1e-10
    assert rec.meta["balance"]["energy"] < 1e-6  # quadrature of fourth order, second at the valves' kinks


VALVE = Path(__file__).parents[2] / "examples" / "circuits" / "muscle-on-a-valve.toml"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('\npressure = "6.9 bar"', '\npressure = "6.9 Pa"', "inflates no muscle"),
        ('\npressure = "6.9 bar"', '\npressure = "6900 bar"', "must be between"),
        ('length = "14 cm"', 'length = "14 m"', "must be between 1.4 cm and 15.4 cm"),
        ('length = "14 cm"', 'length = "14 mm"', "must be between 1.4 cm and 15.4 cm"),
        ('length = "50 cm"', 'length = "500 m"', "must be between"),
        ('length = "50 cm"', 'length = "5 mm"', "elements.tube.length of 0.005 m can hardly be meant"),
        ('diameter = "3.175 mm"', 'diameter = "3.175 um"', "must be between"),
        ('lag = "3 ms"', 'lag = "3 s"', "elements.valve.lag of 3 s can hardly be meant"),
        ("values = [-1, 1, -1]", "values = [-1, 3e5, -1]", "opening of 300000 is beyond its range, -1 to 1"),
    ],
)
def test_what_can_hardly_be_meant_in_a_file_is_refused_or_stands_with_its_run(tmp_path, old, new, sentence):
    text = VALVE.read_text()
    assert text.count(old) == 1
    file = tmp_path / "own.toml"
    file.write_text(text.replace(old, new).replace('duration = "1 s"', 'duration = "60 ms"'))
    try:
        plan = read_circuit(file)
        said = [str(one) for one in plan.cautions]
    except InputError as error:
        assert sentence in str(error)
        return
    assert any(sentence in one for one in said)
    with pytest.warns(PlausibilityWarning):
        assert set(said) <= set(run_circuit(plan).meta["warnings"])


@pytest.mark.parametrize(
    ("file", "path", "usual", "slip", "sentence"),
    [
        ("muscle-on-a-valve", "run.period", "100 ms", "0.5 s", "a period of 500 ms leaves 3 samples of 1 s"),
        ("muscle-on-a-valve", "run.step", "1 us", "1 ns", "a run.step of 1e-09 s can hardly be meant"),
        ("compressor-and-tank", "elements.compressor.speed", "1450 rpm", "1450 rad/s", "was 1450 rpm meant?"),
    ],
)
def test_a_time_or_a_speed_in_another_unit_is_said(file, path, usual, slip, sentence):
    plan = read_circuit(VALVE.parent / f"{file}.toml")
    assert plan.change({path: usual}).cautions == ()
    assert sentence in str(plan.change({path: slip}).cautions[0])


def test_a_circuit_says_what_is_known_of_the_error_of_its_muscles_law(tmp_path):
    file = tmp_path / "own.toml"
    text = VALVE.read_text().replace('length = "14 cm"', 'length = "18 cm"')
    file.write_text(text.replace('specimen = "nylon"', 'specimen = "SM20"'))
    said = mk.muscle("SM20").cautions
    assert said and set(said) <= set(read_circuit(file).cautions)


def test_a_biological_muscle_in_a_circuit_is_refused_as_one(tmp_path):
    file = tmp_path / "own.toml"
    file.write_text(VALVE.read_text().replace('specimen = "nylon"', 'specimen = "slow-fibre"'))
    with pytest.raises(InputError, match=r"nodes.muscle.specimen must be a McKibben muscle, got 'slow-fibre'"):
        read_circuit(file)


def test_the_circuits_that_ship_are_taken_without_a_word():
    for file in sorted(VALVE.parent.glob("*.toml")):
        assert read_circuit(file).cautions == ()


@pytest.mark.parametrize(("kind", "key"), [(kind, key) for kind in ELEMENTS for key in known_keys(kind)])
def test_every_documented_key_of_an_element_is_read(kind, key):
    """A key may be refused beside another one, or for its value, but never as unknown, nor taken for a port: `C`, `b`."""
    ports = ELEMENTS[kind].ports
    ends = ("from", "to") if len(ports) == 2 else ports
    unit = known_keys(kind)[key].unit
    table = {"kind": kind, key: 0.3 if unit == "1" else f"0.3 {unit}"} | dict.fromkeys(ends, "left")
    place = Place("elements.part")
    try:
        read_table(ElementTable, place.table(table), owner="an element has").planned(place, ["left"])
    except InputError as error:
        assert not re.search("ports are|Unknown|Did you mean", str(error)), str(error)


def test_an_orifice_is_stated_by_its_two_numbers_of_iso_6358():
    text = {"kind": "orifice", "from": "left", "to": "right", "C": "1 l/(s*bar)", "b": 0.3}
    place = Place("elements.part")
    branch = (
        read_table(ElementTable, place.table(text), owner="an element has").planned(place, ["left", "right"]).branch
    )
    assert branch.ports == ("left", "right")
    assert float(branch.element.critical_ratio) == 0.3
    assert float(branch.element.conductance) == pytest.approx(1e-8)
