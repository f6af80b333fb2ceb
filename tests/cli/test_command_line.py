"""What all commands have in common: help, files by their suffix, pipes, quiet, cautions, completion and Ctrl-C."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mckibben.bench.rig_file import rig_names
from mckibben.cli import _values, main
from mckibben.cli.app import table_of_commands
from mckibben.cli.completion import SCRIPTS, candidates
from mckibben.experiments.read import protocol_names, stimulation_protocol_names
from mckibben.muscles.laws import LAWS
from mckibben.recordings import read_recording
from mckibben.recordings.tables import write_table
from mckibben.slips import size_caution
from mckibben.specimens import specimen_ids

POINT = ("tension", "nylon", "--length", "12 cm", "--pressure", "5 bar")


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(list(words))
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


# ---- help


def test_help_is_the_same_by_every_way_to_ask_for_it(run):
    texts = [
        run(*words) for words in (("circuit", "run", "-h"), ("circuit", "run", "--help"), ("help", "circuit", "run"))
    ]
    assert {code for code, _, _ in texts} == {0}
    assert len({out for _, out, _ in texts}) == 1 and "Usage: mckibben circuit run" in texts[0][1]
    assert run("help")[1] == run("--help")[1]


# ---- files


def test_one_call_writes_every_file_by_its_suffix(run, tmp_path):
    names = ["p.csv", "p.json"]
    code, out, err = run(*POINT, *(word for name in names for word in ("--out", name)))
    assert (code, err) == (0, "") and [line for line in out.splitlines() if line.startswith("Written")] == [
        f"Written: {name}" for name in names
    ]
    (row,) = csv.DictReader(io.StringIO((tmp_path / "p.csv").read_text()))
    found = json.loads((tmp_path / "p.json").read_text())
    assert float(row["tension [N]"]) == found["tension"] == json.loads(run(*POINT, "--json")[1])["tension"]


def test_a_suffix_that_is_not_written_is_refused_before_anything_is_computed(run):
    code, out, err = run(*POINT, "--out", "p.docx")
    assert (code, out) == (2, "") and "--out must be a name that ends in .csv" in err


@pytest.mark.parametrize("suffix", [".csv", ".json", ".xlsx", ".parquet"])
def test_a_table_is_read_back_with_its_units(tmp_path, suffix):
    path = write_table({"length": [0.1, 0.2], "law": ["a", "b"]}, tmp_path / f"t{suffix}", units={"length": "m"})
    if suffix == ".csv":
        assert path.read_text() == "length [m],law\n0.1,a\n0.2,b\n"
    elif suffix == ".json":
        assert json.loads(path.read_text()) == {"length [m]": [0.1, 0.2], "law": ["a", "b"]}
    elif suffix == ".xlsx":
        openpyxl = pytest.importorskip("openpyxl")
        assert list(openpyxl.load_workbook(path).active.values) == [("length [m]", "law"), (0.1, "a"), (0.2, "b")]
    else:
        polars = pytest.importorskip("polars")
        assert polars.read_parquet(path).to_dict(as_series=False) == {"length [m]": [0.1, 0.2], "law": ["a", "b"]}


# ---- pipes


def test_a_dash_prints_the_file_and_nothing_else(run):
    code, out, err = run(*POINT, "--out", "-")
    assert (code, err) == (0, "") and out.startswith("length [m],pressure [Pa],tension [N]") and out.count("\n") == 2


def test_a_dash_reads_standard_input(run, monkeypatch):
    code, text, _ = run("tension", "nylon", "--contraction", "0:20:10 %", "--pressure", "1:3 bar", "--out", "-")
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    code, out, _ = run("read", "-", "--json")
    assert code == 0 and json.loads(out)["rows"] == 9
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    code, _, err = run("read", "-", "--json")
    assert code == 2 and "standard input" in err and "/mckibben-" not in err


def test_quiet_prints_what_was_asked_for_and_nothing_else(run):
    assert run(*POINT, "--quiet") == (0, "", "")
    assert run(*POINT, "-q", "--json")[1] == run(*POINT, "--json")[1]
    assert run("tension", "nylon", "--length", "12 mm", "--pressure", "5 bar", "-q")[2] == ""  # no caution either
    code, _, err = run("show", "nylom", "-q")
    assert code == 2 and "Did you mean 'nylon'?" in err


# ---- contraction, ranges


def test_a_contraction_is_a_length(run):
    by_length = json.loads(run("tension", "nylon", "--length", "11.2 cm", "--pressure", "5 bar", "--json")[1])
    by_share = json.loads(run("tension", "nylon", "--contraction", "20%", "--pressure", "5 bar", "--json")[1])
    assert by_share["length"] == pytest.approx(0.112, abs=1e-15)  # 14 cm at rest; products of rounded numbers
    assert by_share["tension"] == pytest.approx(by_length["tension"], rel=1e-12)
    for words in (("--contraction", "20%", "--length", "12 cm"), ()):
        assert run("tension", "nylon", *words, "--pressure", "5 bar")[0] == 2
    assert "--contraction" in run("tension", "nylon", "--contraction", "150 %", "--pressure", "5 bar")[2]


def test_ranges_give_every_pair(run):
    found = json.loads(run("tension", "nylon", "--contraction", "0:10:5 %", "--pressure", "1:3 bar", "--json")[1])
    assert [(round(p["length"], 6), p["pressure"]) for p in found["points"]] == [
        (length, pressure) for length in (0.14, 0.133, 0.126) for pressure in (1e5, 2e5, 3e5)
    ]


# ---- cautions


@pytest.mark.parametrize(
    ("text", "unit", "meant"),
    [
        ("300 m", "m", "300 mm"), ("50 MN", "N", "50 N"), ("500 bar", "Pa", "500 kPa"), ("20 kg*m^2", "kg*m^2", "kg*cm^2"),
        ("12 cm", "m", None), ("0 bar", "Pa", None), ("5", "Pa", None), ("abc", "Pa", None), ("5 furlongz", "m", None),
    ],
)  # fmt: skip
def test_a_value_that_can_only_be_a_slip_names_the_likely_unit(text, unit, meant):
    said = size_caution(text, unit, name="value", usual=(1e3, 3e6) if unit == "Pa" else None)
    assert (said is None) == (meant is None)
    assert meant is None or f"{meant} meant?" in str(said)


def test_a_caution_of_any_option_is_printed_and_stands_in_the_object(run):
    code, out, err = run("parts", "valves", "--max-mass", "3000 kg", "--json")
    (said,) = json.loads(out)["warnings"]
    assert code == 0 and said in err and "was 3000 g meant?" in said


# ---- completion


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("mckibben re", {"read", "reproduce", "record"}),
        ("mckibben record re", {"repair", "repeatability", "report"}),
        ("mckibben run isok", {"isokinetic"}),
        ("mckibben run work-loop --muscle nyl", {"nylon"}),
        ("mckibben run work-loop --rig pap", {"paper", "paper-isothermal"}),
        ("mckibben tension nylon --law sa", {"sarosi"}),
        ("mckibben fit t.csv --re", {"--rest-length"}),
        ("mckibben energy nylon --cycle=ma", {"--cycle=maximal"}),
        ("mckibben run work-loop --set cyc", {"cycles="}),
        ("mckibben help cir", {"circuit"}),
        ("mckibben tension 'nyl", {"nylon"}),
        ("mckibben nosuch x", set()),
    ],
)
def test_the_shell_is_offered_what_fits(line, expected):
    assert {one.word for one in candidates(line, table_of_commands())[1]} == expected


def test_files_of_the_right_kind_are_offered(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.nc", "a.toml", "a.txt"):
        (tmp_path / name).touch()
    (tmp_path / "ab").mkdir()
    assert {one.word for one in candidates("mckibben record plot a", table_of_commands())[1]} == {"a.nc", "ab/"}
    assert {one.word for one in candidates("mckibben circuit run a", table_of_commands())[1]} == {"a.toml", "ab/"}


@pytest.mark.usefixtures("shipped_kinds")
def test_the_names_that_are_read_from_files_are_those_of_the_registries():
    muscles = [name for kind in ("mckibben", "biological") for name in specimen_ids(kind)]
    assert sorted(name for name, _ in _values.specimens()) == sorted(muscles)
    assert sorted(name for name, _ in _values.valves()) == sorted(specimen_ids("valve"))
    assert sorted(name for name, _ in _values.laws()) == sorted(LAWS)
    assert [name for name, _ in _values.protocols()] == [*protocol_names(), *stimulation_protocol_names()]
    assert [name for name, _ in _values.rigs()] == rig_names()


@pytest.mark.parametrize("line", ["mckibben tension nylon --", "mckibben fit DM", "mckibben study robot --"])
def test_completion_loads_nothing_that_computes(line):
    heavy = ("jax", "scipy", "pint", "matplotlib", "pandas", "mckibben.muscles.law")
    code = (
        f"import sys\nfrom mckibben.cli import main\ntry: main(['completion', 'bash', '--line', {line!r}])\n"
        f"except SystemExit: print([m for m in {heavy!r} if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout and done.stderr.splitlines()[-1] == "[]"


def test_bash_takes_the_script_and_completes():
    words = f'{SCRIPTS["bash"]}\nmckibben() {{ {sys.executable} -m mckibben "$@"; }}\n'
    words += 'COMP_LINE="mckibben run work-loop --set cyc"; COMP_POINT=${#COMP_LINE}; _mckibben; echo "${COMPREPLY[@]}"'
    done = subprocess.run(["bash", "-c", words], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "cycles="


# ---- Ctrl-C

LONG = """
import hashlib, sys, time
from mckibben.cli import _progress, app, main
def work(*_):
    with _progress.progress("working", 10, saved="three of ten parts are kept"):
        print("ready", flush=True)
        {work}
    return 0
app._execute = work
main(["muscles"])
"""
COMPILED = "hashlib.pbkdf2_hmac('sha256', b'', b'', 10**9)"  # which Python cannot interrupt


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
@pytest.mark.parametrize(
    ("work", "said"), [(COMPILED, "three of ten parts are kept"), ("signal.pause()", "nothing was written")]
)
def test_the_system_ends_compiled_code_and_what_no_command_handles_as_ctrl_c_does(work, said, name):
    number = getattr(signal, name)
    code = f"import signal\nsignal.signal({int(number)}, signal.SIG_DFL){LONG.format(work=work)}"
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code], stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(0.1)
        process.send_signal(number)
        try:
            _, err = process.communicate(timeout=15.0)
        finally:
            process.kill()
    assert (process.returncode, err) == (128 + number, f"mckibben: interrupted; {said}\n")


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("work", "code"),
    [
        (COMPILED, 130),
        ("with _progress.protected(): time.sleep(0.4); sys.exit(7)", 7),  # a file that is being written is finished
    ],
)
def test_ctrl_c_ends_at_once_and_says_what_is_kept(work, code):
    if code == 7:
        work = "import signal; signal.signal(signal.SIGINT, lambda *_: None)\n        " + work
    process = subprocess.Popen(
        [sys.executable, "-c", LONG.format(work=work)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=15.0)
    assert process.returncode == code
    assert err == ("mckibben: interrupted; three of ten parts are kept\n" if code == 130 else "")


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("done", "kept"),
    [
        ((), "no stage was done, and nothing was kept"),
        (("seat", "leak"), "seat, leak of 6 stages are in muscle, and the same command goes on"),
    ],
)
def test_ctrl_c_in_a_characterisation_names_the_stages_that_are_kept(done, kept, tmp_path, monkeypatch, capsys):
    from mckibben.errors import StageError
    from mckibben.studies import characterisation

    def interrupted(machine, stage, protocol, progress, stop):
        for stage in done:
            characterisation.verb.place_of(Path("muscle"), stage).touch()
        os.kill(os.getpid(), signal.SIGINT)
        assert stop()
        raise StageError("ramp", "stopped")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(characterisation.verb._Machine, "run", interrupted)
    with pytest.raises(SystemExit) as stop:
        main(["characterise", "--muscle", "nylon", "--out", "muscle"])
    assert stop.value.code == 130
    assert capsys.readouterr().err == f"mckibben: interrupted in stage ramp; vented; {kept}\n"


TANK = """schema = 1
[nodes.port]
kind = "reservoir"
pressure = "2.1 bar"
[nodes.tank]
kind = "volume"
volume = "1 cm^3"
[elements.tube]
kind = "lumped_tube"
from = "port"
to = "tank"
length = "3 m"
diameter = "2.5 mm"
[run]
duration = "3000 s"
"""
TOLD = """
from mckibben.bench import circuit_run
run = circuit_run.run_circuit
circuit_run.run_circuit = lambda plan, progress: run(plan, progress=lambda words: print("ready", flush=True))
from mckibben.cli import main
main(["circuit", "run", "tank.toml", "--out", "kept.nc"])
"""


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGTERM in the background of a script"])
def test_the_system_ends_a_command_as_ctrl_c_does_and_keeps_what_that_keeps(name, tmp_path):
    (tmp_path / "tank.toml").write_text(TANK)
    name, _, background = name.partition(" ")
    # as a shell leaves it: in the background of a script Ctrl-C is ignored; what runs the tests may be there itself
    left = "import signal\nsignal.signal(signal.SIGHUP, signal.SIG_DFL)\nsignal.signal(signal.SIGINT, signal."
    left += ("SIG_IGN" if background else "default_int_handler") + ")\n"
    process = subprocess.Popen(
        [sys.executable, "-c", left + TOLD], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=tmp_path
    )
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    number = getattr(signal, name)
    process.send_signal(number)
    said, _ = process.communicate(timeout=60.0)
    assert process.returncode == 128 + number, said
    assert read_recording(tmp_path / "kept.nc").meta["result"] == "interrupted"


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_while_the_program_is_loaded_is_said_in_one_sentence():
    # The signal arrives while the table of commands is imported, long before a command begins.
    early = "import signal, sys\nimport mckibben.cli as cli\n"
    # Raised in this thread: one that another thread took would not end the pause.
    early += "class Interrupted:\n    def __getattr__(self, name):\n        signal.raise_signal(signal.SIGINT)\n"
    early += "        signal.pause()\ncli._app = Interrupted()\ncli.main(['muscles'])\n"
    process = subprocess.run([sys.executable, "-c", early], capture_output=True, text=True, timeout=60.0, check=False)
    assert (process.returncode, process.stdout) == (130, "")
    assert process.stderr == "mckibben: interrupted; nothing was written\n"


def test_ctrl_c_in_a_command_is_said_in_one_sentence(run, monkeypatch):
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("mckibben.studies.description.specimen", interrupt)
    assert run("show", "nylon") == (130, "", "mckibben: interrupted; nothing was written\n")


@pytest.mark.parametrize(("patience", "said"), [(0.0, "sizing: braids\n"), (60.0, "")])
def test_progress_in_a_pipe_is_lines_of_work_that_takes_long(patience, said, tmp_path: Path, monkeypatch):
    from mckibben.cli import _progress

    monkeypatch.setattr(_progress, "PATIENT_PIPE", patience)
    with open(tmp_path / "said", "w+", encoding="utf-8") as pipe:
        with monkeypatch.context() as patch:
            patch.setattr(sys, "stderr", pipe)
            with _progress.told("sizing", 3) as tell:
                tell("braids")
        pipe.seek(0)
        assert pipe.read() == said


def test_progress_is_silent_where_it_is_to_be_quiet(run, tmp_path: Path):
    code, _, err = run("circuit", "run", str(Path(__file__).parents[2] / "examples/circuits/filling-a-tank.toml"), "-q")
    assert (code, err) == (0, "")
