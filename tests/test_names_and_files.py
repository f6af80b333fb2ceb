"""Lists of names, names of files, and numbers beside a limit: whatever takes one says what is wrong with it."""

import math
import time
from pathlib import Path

import numpy as np
import pytest

import mckibben as mk
from mckibben import verbs
from mckibben.batch.variants import grid
from mckibben.bench.software.interlocks import SPAN_TOLERANCE, Trip
from mckibben.cli import _command, verb_commands
from mckibben.cli._verb import VerbCommand, VerbsCommand
from mckibben.components.flow import Environment
from mckibben.documents import path_text
from mckibben.errors import InputError, each_once
from mckibben.estimation import misfit
from mckibben.identification.constraints import Constraint, fit_constraints
from mckibben.quantities import Quantity, told_apart
from mckibben.recordings.calibration_file import describe_calibration, read_calibration

CIRCUIT = Path(__file__).parents[1] / "examples/circuits/muscle-on-a-valve.toml"
TWICE = "must be stated once, got .*; it is there twice"
PLACES = {
    one.place
    for command in vars(verb_commands).values()
    for one in (
        [command] if isinstance(command, VerbCommand)
        else [command.first, *(a.command for a in command.others)] if isinstance(command, VerbsCommand)
        else []
    )
}  # fmt: skip
LISTS = [
    (place, p)
    for place in sorted(PLACES)
    for p in verbs.described(place).parameters.values()
    if p.many and not p.type.unit
]


@pytest.mark.parametrize(("place", "parameter"), LISTS, ids=[f"{place}.{p.name}" for place, p in LISTS])
def test_a_verb_takes_a_name_once(place, parameter):
    assert parameter.read(["a", "b"]) == ["a", "b"]
    if parameter.type.word == "LENGTH,PRESSURE,FORCE":  # two readings of one value are two readings
        assert parameter.read(["a", "a"]) == ["a", "a"]
        return
    for spelled in ("a", "./a", Path("a")):
        with pytest.raises(InputError, match=rf"^{parameter.name} {TWICE}$"):
            parameter.read(["a", spelled])


def test_what_python_is_given_twice_is_refused_as_what_is_typed_twice():
    points = mk.specimen("DMSP-20-300").force_map()
    law = type(mk.law("ideal", {"thread_length": 0.3, "turns": 2.0}))
    reached = Constraint("tension", 50.0, pressure=3e5, length=0.28)
    for field, ask in {
        "law": lambda: mk.fit(points, ["sarosi", law, "ideal"], schemes=()),
        "free": lambda: mk.fit(points, "ideal", free=("turns", "thread_length", "turns"), schemes=()),
        "schemes": lambda: mk.fit(points, "ideal", schemes=("pressure", "pressure")),
        "controller": lambda: mk.control.score("pid,pid", plants=0),
        "muscle.law.turns": lambda: grid({"muscle.law.turns": [2.0, 3.0, 2.0]}),
    }.items():
        with pytest.raises(InputError, match=f"^{field} {TWICE}"):
            ask()
    with pytest.raises(InputError, match=f"^free {TWICE}"):
        fit_constraints("ideal", [reached], free=("turns", "turns"), known={"thread_length": 0.3})
    muscle = mk.muscle("nylon")
    with pytest.raises(InputError, match=TWICE):
        each_once("muscles", [muscle, muscle])


@pytest.mark.filterwarnings("ignore:a rest length of 20 cm is beyond")  # which is so, and not what is tested
def test_compared_muscles_of_one_name_have_columns_of_their_own():
    table = mk.compare(mk.muscle("nylon"), mk.muscle("nylon", rest_length="20 cm"))
    rest = next(row for row in table.rows() if row["property"] == "Resting length")
    assert [rest["nylon"], rest["nylon-2"]] == pytest.approx([14.0, 20.0])  # cm


@pytest.fixture
def places(tmp_path, monkeypatch):
    """Names at which there is no file that says anything, with a word of the sentence about each."""
    monkeypatch.chdir(tmp_path)
    suffixes = ("nc", "csv", "mcap", "mat", "xlsx", "h5", "tdms", "parquet", "zip", "ddf")
    for suffix in suffixes:
        Path(f"empty.{suffix}").touch()
    Path("folder.nc").mkdir()
    blank = dict.fromkeys(("", " ", "\t"), "must be a name or the path of a file, got")
    absent = dict.fromkeys(("gone.nc", "gone.csv", "no/gone.nc", "a\0b.nc", "x" * 300 + ".nc"), "not found")
    return blank | absent | {"folder.nc": "folder"} | {f"empty.{suffix}": "empty|suffix" for suffix in suffixes}


READERS = {
    "read_recording": mk.read_recording, "read": mk.read, "read_force_map": mk.read_force_map, "diagnose": mk.diagnose,
    "fit": lambda path: mk.fit(path, "ideal"), "calibration": describe_calibration,
}  # fmt: skip


@pytest.mark.parametrize("reader", READERS)
def test_a_name_without_a_file_that_says_anything_is_refused_for_what_it_is(reader, places):
    for path, word in places.items():
        if path == "folder.nc" and reader in ("read", "read_force_map", "fit"):
            word = "must hold files"  # a folder of one file per pressure is what these take
        with pytest.raises(InputError, match=word) as refused:
            READERS[reader](path)
        assert "\n" not in str(refused.value) and ".: " not in str(refused.value)


@pytest.mark.parametrize("reader", [*READERS, "muscle", "rig", "protocol", "circuit", "calibration file", "plot_loops"])
@pytest.mark.parametrize("value", [None, 3, 1.5, [], {}, b"a.nc", "", "x" * 5000 + ".toml"], ids=repr)
def test_what_is_no_path_is_refused_by_all_that_take_one(reader, value):
    own = {"calibration file": read_calibration}
    with pytest.raises(InputError):
        (READERS | own).get(reader, getattr(mk, reader, None))(value)


def test_a_path_is_typed_with_letters():
    """A path of the parser made of an empty text is the folder where one is."""
    for words in (["log", ""], ["--out", " "]):
        with pytest.raises(InputError, match=f"^{words[0]} must be a name or the path of a file"):
            path_text(words[1], words[0])
    with pytest.raises(InputError, match="^log must be a name"):
        command = _command.PlainValue.__new__(_command.PlainValue)
        command._kind = Path
        command.coerce("", type("Log", (), {"param_type_name": "argument", "name": "log", "opts": ["log"]}), None)


@pytest.mark.parametrize("limit", [0.4, 6.2e5, 1.0, 1e-3, 264.0, -0.125])
@pytest.mark.parametrize("unit", ["m", "Pa", "N", "1", "m/s"])
@pytest.mark.parametrize("relative", [1e-1, 1e-4, 1e-7, 1e-10, 1e-13])
def test_a_refused_value_is_printed_as_another_than_its_limit(limit, unit, relative):
    beyond = limit + relative * abs(limit)
    shown, bound = told_apart(unit, beyond, limit)
    assert shown != bound
    q = Quantity(unit, (-abs(limit) * 9.0, limit), "", "", (0.0, 1.0))
    with pytest.raises(InputError) as refused:
        q.check("x", beyond)
    allowed, got = str(refused.value).split(", got ")
    assert got not in allowed.split(" and ")[1]
    assert told_apart(unit, limit, limit) == (told_apart(unit, limit, 9.0 * limit)[0],) * 2, (
        "equal ones keep four digits"
    )
    assert told_apart(unit, math.nan, limit)[0].startswith("nan")


@pytest.mark.parametrize("seed", range(5))
def test_a_model_that_misses_by_more_than_noise_says_so_and_noise_says_nothing(seed):
    """White noise of 10 % is above `MISSED` and no misfit: of 200 samples its ratio is 2 +- 0.14, far above 1.5."""
    chance, time = np.random.default_rng(seed), np.linspace(0.0, 1.0, 200)
    record = 1.0 - np.exp(-5.0 * time)
    assert misfit("p", record, 0.1 * chance.standard_normal(200)) == []
    assert misfit("p", record, 0.02 * np.sin(9.0 * time)) == [], "within what is called described"
    (said,) = misfit("p", record, 0.1 * np.sin(9.0 * time) + 0.01 * chance.standard_normal(200))
    assert "misses p by" in said and " % of what it spans" in said
    assert misfit("p", record[:7], 0.1 * np.sin(9.0 * time[:7])) == []
    assert misfit("p", np.ones(200), 0.1 * np.sin(9.0 * time)) != []


def test_a_parameter_of_the_law_is_found_without_its_prefix_and_once():
    path, whole = {"muscle.rest_length": "15 cm"}, {"muscle.law.rest_length": "15 cm"}
    short, full = (mk.prepare("isometric-step", muscle="nylon", changes=one) for one in (path, whole))
    assert float(short.unit.law.rest_length) == float(full.unit.law.rest_length) == pytest.approx(0.15, rel=1e-12)
    with pytest.raises(InputError, match=TWICE):
        mk.prepare("isometric-step", muscle="nylon", changes=path | whole)


def test_the_pressure_of_the_room_has_one_name_in_all_files():
    """`pressure` means a gauge pressure everywhere else in a circuit."""
    circuit, rig = mk.circuit(CIRCUIT), mk.rig("modern")
    for change in (lambda name: circuit.change({name: "0.9 bar"}), lambda name: mk.rig("modern", {name: "0.9 bar"})):
        assert float(change("environment.pressure_abs").environment.pressure_abs) == pytest.approx(9e4, rel=1e-12)
        with pytest.raises(InputError, match="environment.pressure'. Did you mean 'pressure_abs'"):
            change("environment.pressure")
    assert float(circuit.environment.pressure_abs) == float(rig.environment.pressure_abs) == 101325.0


@pytest.mark.filterwarnings("ignore::mckibben.errors.PlausibilityWarning")  # the same cautions
@pytest.mark.parametrize(("pressure", "said"), [("6 bar", True), ("1 bar", False)])
def test_a_room_in_which_nobody_measures_is_said_by_circuits_rigs_and_simulations(pressure, said):
    change = {"environment.pressure_abs": pressure}
    run = mk.prepare("isometric-step", muscle="nylon", changes={f"rig.{key}": value for key, value in change.items()})
    air = mk.Air(environment=Environment(pressure_abs=1e5 * float(pressure[0])))
    simulation = mk.Simulation(mk.Weight("nylon"), air)
    for cautions in (mk.circuit(CIRCUIT).change(change).cautions, run.set_point_cautions(), simulation.cautions):
        assert any(one.parameter == "environment.pressure_abs" for one in cautions) is said


def test_a_text_that_begins_with_the_mark_of_its_encoding_is_read(tmp_path):
    """Editors of Windows write it before TOML as before tables."""
    path = tmp_path / "marked.toml"
    path.write_text(CIRCUIT.read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert mk.circuit(path).title == mk.circuit(CIRCUIT).title


def test_a_span_at_the_end_of_the_frame_is_held_by_hand_and_a_trip_shows_what_was_beyond():
    """A regulator swings about its set-point: where the frame's end may be asked for, it is no trip until the tolerance."""
    rig = mk.rig("paper")
    bounds = float(rig.interlocks.shortest), float(rig.interlocks.longest)
    assert bounds == pytest.approx((rig.shortest - SPAN_TOLERANCE, rig.longest + SPAN_TOLERANCE), abs=1e-12)
    said = rig.interlocks.reason(Trip.TOO_LONG, {"span": bounds[1] + 1e-7}, 0.1)
    assert "the span is 40.03001 cm; it must be 40.03 cm or less" in said
    with mk.Session(rig, "DMSP-40-400") as session:
        for span in (rig.longest - 0.01, rig.longest):
            session.set(span=span)
            time.sleep(2.0)  # the way takes a second; it tripped half a second after
        assert session.why == ""
        assert session.latest()["span"] == pytest.approx(rig.longest, abs=SPAN_TOLERANCE)


@pytest.mark.parametrize(("force", "said"), [(-20.0, True), (-0.1, False), (0.0, False)])
def test_a_table_in_which_the_muscle_pushes_is_read_and_says_so(tmp_path, force, said):
    path = tmp_path / "map.csv"
    path.write_text(f"length [mm],pressure [bar],force [N]\n110,3,{force}\n120,3,20\n130,3,30\n")
    assert any("1 of 3 rows push, with 20 N at most" in one for one in mk.read(path).remarks) is said


@pytest.mark.parametrize(
    ("call", "meant"),
    [
        (lambda **more: mk.Air(**more), "supply"),
        (lambda **more: mk.Plate("nylon", **more), "span"),
        (lambda **more: mk.Joint("nylon", "nylon", arm="2 cm", inertia=2e-3, **more), "stops"),
        (lambda **more: mk.muscle("nylon").replace(**more), "law"),
        (lambda **more: mk.muscle("nylon", **more), "rest_length"),
        (lambda **more: mk.fit_all(mk.specimen("DMSP-20-300").force_map(), **more), "schemes"),
        (lambda **more: mk.protocol("isobaric-map", **more), "pressure"),
        (lambda **more: mk.prepare("isobaric-map", muscle="nylon", **more), "pressure"),
        (lambda **more: mk.Simulation(mk.Plate("nylon"), mk.Air()).step(**more), "span"),
    ],
)
def test_an_unknown_argument_is_refused_by_a_sentence_that_names_the_one_that_was_meant(call, meant):
    with pytest.raises(InputError, match=f"Unknown .*{meant}x'. Did you mean '{meant}'") as refused:
        call(**{f"{meant}x": 1.0})
    assert meant in refused.value.known
