"""Reading a file never runs what it says; what a person names runs."""

import functools
import json
import os
import struct
import sys
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import pytest
import tomlkit

import mckibben as mk
from mckibben.assembly.circuit_file import read_circuit
from mckibben.batch import read_results
from mckibben.bench.rig_file import CONTROLLERS, rig
from mckibben.cli.app import main
from mckibben.errors import InputError
from mckibben.identification import read_posterior
from mckibben.recordings import Recording, write
from mckibben.registry import CODE, FIXED, allow_code

CANARY = """
from pathlib import Path
Path(__file__).with_name("ran").touch()
import mckibben as mk


class Law(mk.TensionLaw):
    title, cites, fitted = "of a file", (), ("gain",)
    gain = mk.quantity("m^2", (1e-8, 1e-1), "force per pressure at rest")
    rest_length = mk.quantity("m", (1e-3, 10.0), "rest length")

    def elastic_tension(self, length):
        return 0.0 * length

    def gas_energy(self, length, pressure):
        return pressure * self.gain * (2.0 * self.rest_length - length)

    def length_range(self):
        return 0.5 * self.rest_length, 1.1 * self.rest_length
"""
SPECIMEN = """schema = 1
id = "mine"
title = "mine"
kind = "mckibben"
law = "{name}"
sources = []
[properties]
rest_length = {{ value = 30, unit = "cm", inferred = true, note = "x" }}
[laws."{name}"]
gain = {{ value = 1e-3, unit = "m^2", inferred = true, note = "x" }}
rest_length = {{ value = 30, unit = "cm", inferred = true, note = "x" }}
"""
CIRCUIT = """schema = 1
title = "t"
[nodes.supply]
kind = "reservoir"
pressure = "5 bar"
[nodes.tank]
kind = "volume"
volume = "50 ml"
[elements.valve]
kind = "{name}"
from = "supply"
to = "tank"
nominal_flow = "20 l/min"
"""
OWN = "canary.py:Law"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the canary, which is where a program looks for modules, too."""
    (tmp_path / "canary.py").write_text(CANARY)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(CODE, "")
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop("canary", None)


@functools.cache
def sound() -> Recording:
    return mk.run("work-loop", "modern", muscle="nylon", cycles=1)


def recording(meta: dict) -> Recording:
    return sound().with_meta(meta)


def specimen_file(name: str) -> object:
    Path("a.toml").write_text(SPECIMEN.format(name=name))
    return mk.muscle("a.toml")


def friction_file(name: str) -> object:
    text = (resources.files("mckibben.specimens") / "data" / "nylon.toml").read_text()
    Path("a.toml").write_text(f'{text}\n[friction."{name}"]\nconstant = {{ value = 3, unit = "N" }}\n')
    return mk.muscle("a.toml", friction=None if ".py:" in name else name)


def fit_file(name: str) -> object:
    Path("a.json").write_text(json.dumps({"fits": [{"law": name, "posterior": {"law": name, "points": {}}}]}))
    return read_posterior("a.json")


def circuit_file(name: str) -> object:
    Path("a.toml").write_text(CIRCUIT.format(name=name))
    return read_circuit("a.toml")


def changed_rig(change: Callable[[dict], None]) -> dict:
    document = json.loads(json.dumps(dict(rig("modern").document)))
    change(document)
    return document


def sensor_of(name: str) -> Callable[[dict], None]:
    return lambda rig: rig["sensors"].update(x={"kind": name, "low": "0 N", "high": "1 N"})


def rig_sensor(name: str) -> object:
    Path("a.toml").write_text(tomlkit.dumps({"schema": 1, **changed_rig(sensor_of(name))}))
    return rig("a.toml")


def rig_controller(name: str) -> object:
    document = changed_rig(lambda d: d.setdefault("control", {}).update(pressure={"controller": name}))
    Path("a.toml").write_text(tomlkit.dumps({"schema": 1, **document}))
    return rig("a.toml")


def rig_valve(name: str) -> object:
    def change(document: dict) -> None:
        document["plumbing"]["direct"]["valve"]["kind"] = name

    Path("a.toml").write_text(tomlkit.dumps({"schema": 1, **changed_rig(change)}))
    return rig("a.toml")


def protocol_file(name: str) -> object:
    text = f'schema = 1\nname = "h"\n[control.{next(iter(CONTROLLERS))}]\ncontroller = "{name}"\n'
    Path("a.toml").write_text(f'{text}[[steps]]\npressure = "3 bar"\nfor = "0.1 s"\n')
    return mk.prepare("a.toml", muscle="nylon", rig="modern")


def recorded(suffix: str) -> Callable[[str], object]:
    def read(name: str) -> object:
        meta = {"rig_document": changed_rig(sensor_of(name)), "specimen": "nylon", "plumbing": "direct"}
        write(recording(meta), Path(f"a{suffix}"))
        return mk.diagnose(f"a{suffix}") if suffix in (".nc", ".csv", ".mcap") else mk.diagnose(mk.read(f"a{suffix}"))

    return read


def recorded_specimen(name: str) -> object:
    Path("other.toml").write_text(SPECIMEN.format(name=name))
    meta = {"rig_document": dict(rig("modern").document), "specimen": "other.toml", "plumbing": "direct"}
    recording(meta).save("a.nc")
    return mk.diagnose("a.nc")


FILES = {
    "specimen": specimen_file, "friction": friction_file, "fit": fit_file, "circuit": circuit_file, "sensor": rig_sensor,
    "controller": rig_controller, "valve": rig_valve, "protocol": protocol_file,
    "specimen of a recording": recorded_specimen,
    **{f"rig of a recording {s}": recorded(s) for s in (".nc", ".csv", ".mcap", ".mat", ".parquet", ".tdms")},
}  # fmt: skip


@pytest.mark.parametrize("file", FILES)
def test_a_name_in_a_file_runs_nothing(folder: Path, file: str) -> None:
    with pytest.raises(InputError) as refused:
        FILES[file](OWN)
    assert not (folder / "ran").exists()
    said = str(refused.value)
    assert "names code, which a file cannot run by itself" in said and "allow it: --code " in said and "\n" not in said
    in_memory = file.endswith((".mat", ".parquet", ".tdms"))  # what was read is handed over, whose file nobody knows
    assert said.startswith("rig of the recording: " if in_memory else ("a.", "other.toml: "))


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("name", ["canary.Law", "canary:Law", "canary", "canary:Path", "os:system"])
def test_no_file_imports_a_module_by_its_name(folder: Path, file: str, name: str) -> None:
    with pytest.raises(InputError):
        FILES[file](name)
    assert "canary" not in sys.modules and not (folder / "ran").exists()


def mcap_of(kind: str, definition: str) -> bytes:
    def text(value: str) -> bytes:
        return struct.pack("<I", len(value)) + value.encode()

    def record(opcode: int, body: bytes) -> bytes:
        return struct.pack("<BQ", opcode, len(body)) + body

    magic = b"\x89MCAP0\r\n"
    parts = [
        record(1, text("ros2") + text("x")),
        record(3, struct.pack("<H", 1) + text(kind) + text("ros2msg") + text(definition)),
        record(4, struct.pack("<HH", 1, 1) + text("t") + text("cdr") + text("")),
        record(5, struct.pack("<HIQQ", 1, 0, 0, 0) + b"\0\1\0\0" + bytes(8)),
        record(15, bytes(4)),
        record(2, bytes(20)),
    ]
    return magic + b"".join(parts) + magic


MARK = "open('ran', 'w').close()"


@pytest.mark.parametrize(
    ("kind", "definition"),
    [
        (f"a/msg/B:\n    {MARK}\nclass C", "float64 x\n"),
        (f'a/msg/B"""\n{MARK}\n"""', "float64 x\n"),
        ("a/msg/B", f"float64 x\nstring Y='''\n{MARK}\n'''\n"),
        ("a/msg/B", f"float64 x=[{MARK}]\n"),
        ("a/msg/B", f"float64 x\n# {MARK}\nint8 Y={MARK}\n"),
    ],
)
def test_a_definition_of_messages_runs_nothing(folder: Path, kind: str, definition: str) -> None:
    """rosbags makes Python of definitions."""
    Path("a.mcap").write_bytes(mcap_of(kind, definition))
    try:
        mk.read("a.mcap")
    except InputError as error:
        assert "a.mcap" in str(error)
    assert not (folder / "ran").exists()


def test_the_description_of_a_bag_runs_nothing(folder: Path) -> None:
    Path("bag").mkdir()
    Path("bag/metadata.yaml").write_text('!!python/object/apply:os.system ["touch ran"]\n')
    Path("bag/a.db3").write_bytes(b"SQLite format 3\0")
    with pytest.raises(InputError, match="bag"):
        mk.read("bag")
    assert not (folder / "ran").exists()


def test_a_store_of_a_sweep_unpickles_nothing(folder: Path) -> None:
    store = Path("results.zarr")
    about = {"mckibben": {"parameters": []}}
    for place, words in ((store, about), (store / "outputs", {})):
        place.mkdir()
        (place / ".zgroup").write_text('{"zarr_format": 2}')
        (place / ".zattrs").write_text(json.dumps(words))
    array = {
        "zarr_format": 2,
        "shape": [1],
        "chunks": [1],
        "dtype": "|i1",
        "fill_value": 0,
        "order": "C",
        "filters": None,
    }
    for name in ("code", "message", "duration"):
        (store / name).mkdir()
        (store / name / ".zarray").write_text(json.dumps({**array, "compressor": {"id": "pickle"}}))
        (store / name / "0").write_bytes(b"cos\nsystem\n(S'touch ran'\ntR.")
    with pytest.raises(InputError, match="results.zarr"):
        read_results(store)
    assert not (folder / "ran").exists()


@pytest.mark.parametrize("words", [["--code", "canary.py"], ["--code=canary.py"], ["--law", OWN]])
def test_what_the_command_line_names_runs_for_that_command(
    folder: Path, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("a.toml").write_text(SPECIMEN.format(name=OWN))
    with pytest.raises(SystemExit) as end:
        main(["show", "a.toml", *words])
    assert end.value.code == 0 and "of a file" in capsys.readouterr().out
    with pytest.raises(SystemExit) as end:
        main(["show", "a.toml"])
    said = capsys.readouterr().err
    assert end.value.code == 2 and said.startswith("mckibben: a.toml: laws 'canary.py:Law' names code, "), said
    assert not os.environ[CODE]


def test_a_class_in_python_stands_for_the_name_in_the_file(folder: Path) -> None:
    Path("a.toml").write_text(SPECIMEN.format(name=OWN))
    from canary import Law

    assert type(mk.muscle("a.toml", law=Law).law) is Law


def test_a_fit_with_a_law_of_ones_own_is_used_by_naming_its_file(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mk.fit("DMSP-20-300", law=[OWN], schemes=()).save("mine.toml")
    os.environ[CODE] = ""
    with pytest.raises(SystemExit) as end:
        main(["tension", "mine.toml", "--pressure", "3 bar", "--length", "28 cm", "--code", "canary.py"])
    assert end.value.code == 0, capsys.readouterr().err


def test_who_allows_a_file_allows_no_other_of_its_name(folder: Path) -> None:
    (folder / "mine").mkdir()
    for place in (folder, folder / "mine"):
        (place / "twin.py").write_text(CANARY)
    allow_code("mine/twin.py")
    with pytest.raises(InputError, match="names code, which a file cannot run by itself"):
        specimen_file("twin.py:Law")
    assert not (folder / "ran").exists()


def test_a_file_that_does_not_run_says_so_each_time(folder: Path) -> None:
    """What it has defined before it failed is no law."""
    Path("half.py").write_text(f"{CANARY}\nraise RuntimeError('half done')\n")
    allow_code("half.py")
    for _ in range(2):
        with pytest.raises(InputError, match="half.py, line .*RuntimeError: half done"):
            mk.law("half.py:Law", {"gain": 1e-3, "rest_length": 0.3})


def test_a_server_takes_no_code_that_is_named_later(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("other.py").write_text(CANARY)
    Path("a.toml").write_text(SPECIMEN.format(name=OWN))
    seen: list[object] = []

    def serve(*_: object, **__: object) -> None:
        seen.append(type(mk.muscle("a.toml").law).__name__)  # as it was named at the start
        with pytest.raises(InputError, match="names code"):
            mk.law("other.py:Law", {"gain": 1e-3, "rest_length": 0.3})  # as of a page
        with pytest.raises(InputError, match="mckibben serve --code"):
            allow_code("other.py")
        seen.append(os.environ[FIXED])

    monkeypatch.setattr("mckibben.web.server.serve", serve)
    with pytest.raises(SystemExit) as end:
        main(["serve", "--no-open", "--port", "0", "--folder", "recordings", "--code", "canary.py"])
    assert end.value.code == 0 and seen == ["Law", "1"] and FIXED not in os.environ
