"""A law with a fault is found out, by the fault that it has, and a sound one passes."""

import json
import re
from pathlib import Path

import pytest

import mckibben as mk
from mckibben.assembly.check import check
from mckibben.cli.app import main
from mckibben.errors import InputError
from mckibben.muscles.hysteresis import Dahl, FrictionLimit
from mckibben.registry import FIXED, allow_code, fix_code, load_reference

FAULTY = str(Path(__file__).with_name("faulty.py"))
# Each law of `faulty.py`: kinds of its findings in order, and what the first sentence says.
FAULTS = {
    "Sound": ((), ""),
    "MakesEnergy": (("potential", "energy"), r"dF/dP' is 0\.002 m\^2 and -dV/dL is .* m\^2, at 4 cm and 10 bar"),
    "Pushes": (("push", "potential", "energy"), r"pushes with 150 N, at 4 cm and -0\.95 bar"),
    "NotFinite": (("finite",), r"dF/dL is nan, at 4 cm and .* bar, and at \d+ more of 4096 places"),
    "WrongDerivative": (("derivative",), r"dF/dL is .* N/m by its derivative and .* by differences, at .* cm and .* bar"),
    "Branches": (("error", "lowering"), "cannot be evaluated on arrays: ValueError: The truth value of an array"),
    "Sorts": (("lowering",), r"svd \(faulty.py, line \d+, Sorts.elastic_tension\) cannot become a native kernel"),
    "Undeclared": (("declaration",) * 4, "factor has neither unit nor bounds; declare it as mckibben.quantity"),
    "Shrinks": (("volume", "capacitance"), r"has a gas volume of -.* cm\^3, at .* cm and .* bar"),
    "Perpetual": (("passivity",), r"gives back .* J more than was put in, displaced by .* mm at .* bar"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_faulty_law_is_found_out(name: str) -> None:
    found = check(f"{FAULTY}:{name}")
    kinds, sentence = FAULTS[name]
    assert tuple(finding.kind for finding in found) == kinds, found
    if kinds:
        assert re.search(sentence, found[0].sentence), found[0].sentence
        assert found[0].sentence.startswith(f"{FAULTY}:{name}: ")


@pytest.mark.parametrize("law", ["linear_threshold", "ideal"])
def test_the_laws_of_the_package_pass(law: str) -> None:
    known = {"shortest_length": 0.14, "rest_volume": 2e-5} if law == "linear_threshold" else {"thread_length": 0.25}
    assert check(law, known) == []


def test_a_law_without_walls_is_sound_at_0_bar_where_every_length_is_free() -> None:
    # At 0 bar its tension is zero at every length, so that each mixed derivative may be that of another side of a kink.
    assert check(f"{FAULTY}:Sound", {"wall_stiffness": 0.0}) == []


def test_a_friction_of_the_package_passes() -> None:
    assert check(Dahl(limit=FrictionLimit(constant=0.5, per_pressure=4e-6), stiffness=2e3)) == []


def test_the_energy_of_a_fault_is_that_of_its_cycle() -> None:
    # The extra tension c P'^2 does c times the integral of P'^2 dL, of which the volume knows nothing.
    allow_code(FAULTY)
    kind = load_reference(f"{FAULTY}:MakesEnergy", field="law")
    share = {finding.kind: finding.value for finding in check(kind)}["energy"]
    assert 0.01 < share < 1.0


def test_a_parameter_cannot_hide_what_every_law_has() -> None:
    with pytest.raises(InputError, match="Stiff.stiffness hides what every law has of that name; choose another"):
        type("Stiff", (mk.TensionLaw,), {"stiffness": mk.quantity("N/m", (0.0, 1.0), "of the walls")})


@pytest.mark.parametrize(
    ("reference", "text", "sentence"),
    [
        ("none.py:Law", None, "File not found: none.py"),
        ("bad.py:Law", "def (", "bad.py, line 1: SyntaxError: invalid syntax (bad.py, line 1)"),
        ("bad.py:Law", "x = 1\ny = x / 0\n", "bad.py, line 2: ZeroDivisionError: division by zero"),
        ("bad.py:Law", "class Low: pass", "bad.py has no 'Law'. Did you mean 'Low'? It has Low"),
        ("bad.py:Law", "class Law: pass", "bad.py:Law must be a tension law or a friction: "),
    ],
)
def test_a_file_that_holds_no_law_is_refused_in_a_sentence(
    reference: str, text: str | None, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path("bad.py").write_text(text)
    with pytest.raises(SystemExit) as end:
        main(["check", reference])
    assert end.value.code == 2
    assert capsys.readouterr().err.startswith(f"mckibben: {sentence}")


def test_a_changed_file_is_loaded_anew(tmp_path: Path) -> None:
    path = tmp_path / "own.py"
    path.write_text("number = 1\n")
    allow_code(path)
    assert load_reference(f"{path}:number", field="law") == 1
    path.write_text("number = 2\n")
    assert load_reference(f"{path}:number", field="law") == 2


def test_code_is_loaded_from_allowed_files_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("own.py", "other.py", "third.py"):
        (tmp_path / name).write_text("number = 1\n")
    allow_code(tmp_path / "own.py")
    assert load_reference(f"{tmp_path}/own.py:number", field="law") == 1
    with pytest.raises(InputError, match=r"law '.*/other.py:number' names code, .* allow it: --code .*/other.py"):
        load_reference(f"{tmp_path}/other.py:number", field="law")
    monkeypatch.setenv(FIXED, "")
    fix_code()  # as a server does
    with pytest.raises(InputError, match="must be named when the server is started"):
        allow_code(tmp_path / "other.py")
    with pytest.raises(InputError, match="names code"):
        mk.check(f"{tmp_path}/third.py:number")
    assert load_reference(f"{tmp_path}/own.py:number", field="law") == 1


def test_the_command_reports_findings_with_exit_code_1(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["check", f"{FAULTY}:Undeclared", "--json"])
    assert end.value.code == 1
    found = json.loads(capsys.readouterr().out)["findings"]
    assert [one["kind"] for one in found] == ["declaration"] * 4


def test_a_law_that_fits_what_it_does_not_declare_is_refused(tmp_path):
    (tmp_path / "mine.py").write_text(
        "import mckibben as mk\nclass Mine(mk.TensionLaw):\n    title, cites, fitted = 'mine', (), ('aera',)\n"
        "    area = mk.quantity('m^2', (0.0, 1.0), 'force per pressure')\n"
        "    def elastic_tension(self, length): return 0.0 * length\n"
        "    def gas_energy(self, length, pressure): return -self.area * pressure * length\n"
        "    def length_range(self): return 0.1, 0.2\n"
    )
    with pytest.raises(InputError, match="fitted names no parameter of it: aera"):
        mk.check(f"{tmp_path}/mine.py:Mine", {"area": 1e-4})


def test_a_law_whose_methods_take_other_arguments_is_refused(tmp_path):
    (tmp_path / "mine.py").write_text(
        "import mckibben as mk\nclass Mine(mk.TensionLaw):\n    title, cites, fitted = 'mine', (), ()\n"
        "    def elastic_tension(self, length, pressure): return 0.0 * length\n"
        "    def gas_energy(self, length, pressure): return -1e-4 * pressure * length\n"
        "    def length_range(self): return 0.1, 0.2\n"
    )
    with pytest.raises(InputError, match=r"elastic_tension must take \(self, length\)"):
        mk.check(f"{tmp_path}/mine.py:Mine", {})
