"""Nothing that is typed ends in a traceback: strange numbers and files are answered, or refused in one sentence."""

import os

import pytest

from mckibben.cli import main
from mckibben.cli.app import table_of_commands

NUMBERS = ("0", "-1", "1e-320 N", "1e308 m", "nan", "", "x" * 3000)
CALLS = {
    "tension": ["nylon", "--length", "12 cm", "--pressure", "5 bar"],
    "braid": ["--length", "300 mm", "--angle", "25 deg", "--diameter", "12 mm", "--thread", "0.25 mm"],
    "parts": ["valves"],
}
FILES = {
    "read": [], "record show": [], "fit": ["--law", "ideal"], "circuit show": [], "circuit run": [], "next": ["--from"],
    "record list": [], "record convert": ["out.csv"], "show": [], "calibration show": [], "sweep": ["--out", "swept"],
}  # fmt: skip


def ended(words: list[str], capsys) -> tuple[int, str]:
    """Exit code and what was said on standard error; anything but an exit is an error of the program."""
    with pytest.raises(SystemExit) as stop:
        main(words)
    code = stop.value.code or 0
    return code, capsys.readouterr().err


def options_of(name: str) -> list[str]:
    command = table_of_commands()
    for part in name.split():
        command = command.commands[part]
    valued = [p for p in command.params if p.param_type_name == "option" and not p.is_flag]
    return [p.opts[0] for p in valued if not {"--style", "--width", "--out"} & set(p.opts)]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers at the edge of what a float holds; not of tracebacks
@pytest.mark.parametrize(("name", "option"), [(n, o) for n in CALLS for o in options_of(n)])
def test_a_strange_number_is_answered_or_refused_in_a_sentence(name, option, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = CALLS[name]
    if option in words:
        at = words.index(option)
        words = words[:at] + words[at + 2 :]
    for value in NUMBERS:
        code, said = ended([*name.split(), *words, option, value], capsys)
        assert code in (0, 1, 2), (value, code)
        refusals = [line for line in said.splitlines() if not line.startswith(("mckibben: caution", "mckibben: note"))]
        assert code != 2 or (len(refusals) <= 5 and "Traceback" not in said), said[:500]


@pytest.fixture
def strange(tmp_path, monkeypatch):
    """A folder with files that are none of what their names say."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    for ending in ("csv", "toml", "nc", "json", "xlsx", "mat", "mcap", "parquet", "txt"):
        (tmp_path / f"empty.{ending}").touch()
        (tmp_path / f"noise.{ending}").write_bytes(bytes(range(256)) * 20)
    (tmp_path / "closed.csv").write_text("a\n1\n")
    os.chmod(tmp_path / "closed.csv", 0)
    return [*sorted(p.name for p in tmp_path.iterdir()), "/dev/null", "", "no/such.csv", "y" * 300]


@pytest.mark.parametrize("name", FILES)
def test_a_strange_file_is_refused_in_a_sentence(name, strange, capsys):
    for file in strange:
        words = [*FILES[name], file] if name == "next" else [file, *FILES[name]]
        code, said = ended([*name.split(), *words], capsys)
        assert code in (0, 1, 2) and "Traceback" not in said, file
        assert code != 2 or said.startswith("mckibben: "), said


def test_a_number_that_no_one_can_mean_is_refused_and_zero_is_none(capsys):
    code, said = ended(["size", "--force", "1e-320 N", "--stroke", "20 mm", "--pressure", "5 bar"], capsys)
    assert code == 2 and "--force must be 0 or from 1e-100 to 1e+100 in size, got 1e-320 N" in said
