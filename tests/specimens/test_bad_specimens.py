"""A specimen file that is wrong is refused in one line that names the file, the field, the value and what is allowed."""

from pathlib import Path

import pytest

import mckibben.specimens
from mckibben.errors import InputError
from mckibben.muscles import law_from_specimen
from mckibben.specimens import specimen, specimen_ids, specimens

GOOD = """\
schema = 1
id = "mine"
kind = "mckibben"
title = "A muscle from my desk"
sources = ["me"]
law = "ideal"

[properties.rest_length]
value = 20.0
unit = "cm"

[properties.rest_angle]
value = 25.0
unit = "deg"

[laws.ideal.thread_length]
value = 22.0
unit = "cm"

[laws.ideal.turns]
value = 2.5
unit = "1"
"""


def write(folder: Path, old: str = "", new: str = "") -> Path:
    assert old in GOOD
    path = folder / "mine.toml"
    path.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    return path


def refusal(path: Path, *, build: bool = False) -> str:
    with pytest.raises(InputError) as refused:
        law_from_specimen(specimen(path)) if build else specimen(path)
    said = str(refused.value)
    assert "\n" not in said
    assert "mine.toml" in said  # the file
    assert refused.value.field in said  # the field
    assert refused.value.problem or refused.value.known or refused.value.sentence  # what it must be
    return said


def test_the_file_that_the_others_are_bent_from_is_good(tmp_path: Path) -> None:
    mine = specimen(write(tmp_path))
    assert mine.id == "mine"
    assert mine.property_si("rest_length", "m") == pytest.approx(0.2)
    assert float(law_from_specimen(mine).tension(0.2, 3e5)) > 0.0


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ('title = "', 'colour = "red"\ntitle = "', "colour"),
        ('unit = "cm"\n\n[properties.rest_angle]', 'unit = "cm"\ncolour = "red"\n\n[properties.rest_angle]', "colour"),
        ("[properties.rest_angle]", "[properties.colour]", "properties.colour"),
    ],
)
def test_an_unknown_key_is_named(tmp_path: Path, old: str, new: str, field: str) -> None:
    said = refusal(write(tmp_path, old, new))
    assert field in said
    assert "Unknown" in said  # the folder has the name of the test


def test_an_unknown_law_parameter_is_named_when_the_law_is_built(tmp_path: Path) -> None:
    said = refusal(write(tmp_path, "[laws.ideal.turns]", "[laws.ideal.colour]"), build=True)
    assert "laws.ideal.colour" in said
    assert "turns" in said  # what it could be


def test_an_unknown_law_is_named_with_the_nearest(tmp_path: Path) -> None:
    path = write(tmp_path, 'law = "ideal"', 'law = "ideel"')
    said = refusal(path)
    assert "ideel" in said
    assert "ideal" in said.replace("ideel", "")


@pytest.mark.parametrize("value", ["-20.0", "-1e-3"])
def test_a_negative_length_is_refused(tmp_path: Path, value: str) -> None:
    said = refusal(write(tmp_path, "value = 20.0", f"value = {value}"))
    assert "properties.rest_length" in said
    assert "not negative" in said


def test_a_negative_length_of_a_law_is_refused_with_its_bounds(tmp_path: Path) -> None:
    said = refusal(write(tmp_path, "value = 22.0", "value = -22.0"), build=True)
    assert "thread_length" in said
    assert "-22 cm" in said
    assert "0.1 cm" in said


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_a_number_that_is_not_finite_is_refused(tmp_path: Path, value: str) -> None:
    said = refusal(write(tmp_path, "value = 20.0", f"value = {value}"))
    assert "properties.rest_length" in said
    assert "finite" in said


@pytest.mark.parametrize("unit", ["bar", "cm^2", "N", "deg", "1"])
def test_a_unit_of_the_wrong_dimension_is_refused(tmp_path: Path, unit: str) -> None:
    said = refusal(write(tmp_path, 'value = 20.0\nunit = "cm"', f'value = 20.0\nunit = "{unit}"'))
    assert f"20 {unit}" in said
    assert "a length such as '12 cm'" in said


@pytest.mark.parametrize("unit", ["bar", "N/m"])
def test_a_unit_of_the_wrong_dimension_in_a_law_is_refused(tmp_path: Path, unit: str) -> None:
    said = refusal(write(tmp_path, 'value = 22.0\nunit = "cm"', f'value = 22.0\nunit = "{unit}"'), build=True)
    assert "laws.ideal.thread_length" in said
    assert f"22 {unit}" in said


@pytest.mark.parametrize("unit", ["cmm", "furlongs per fortnight maybe", "", "cm cm cm"])
def test_an_unknown_unit_is_refused(tmp_path: Path, unit: str) -> None:
    said = refusal(write(tmp_path, 'value = 20.0\nunit = "cm"', f'value = 20.0\nunit = "{unit}"'))
    assert "a length such as '12 cm'" in said


@pytest.mark.parametrize(
    "gone", ["value = 20.0\n", 'unit = "cm"\n', 'title = "A muscle from my desk"\n', 'id = "mine"\n']
)
def test_a_missing_key_is_named(tmp_path: Path, gone: str) -> None:
    said = refusal(write(tmp_path, gone, ""))
    assert "missing" in said
    assert gone.split()[0] in said


def test_a_missing_parameter_of_a_law_is_named(tmp_path: Path) -> None:
    said = refusal(write(tmp_path, '[laws.ideal.turns]\nvalue = 2.5\nunit = "1"\n', ""), build=True)
    assert "the law ideal needs turns" in said


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("value = 20.0", 'value = "20"', "properties.rest_length.value"),
        ("value = 20.0", "value = true", "properties.rest_length.value"),
        ("value = 20.0", "value = []", "properties.rest_length.value"),
        ("value = 20.0", "value = 20.0\nrange = [19.0]", "properties.rest_length.range"),
        ("value = 20.0", 'value = 20.0\nrange = ["19", 21.0]', "properties.rest_length.range"),
        ("value = 20.0", 'value = 20.0\nrange = "ab"', "properties.rest_length.range"),
        ('kind = "mckibben"', 'kind = "hydraulic"', "kind"),
        ('id = "mine"', 'id = "my muscle"', "id"),
        ("schema = 1", "schema = 99", "schema"),
        ("schema = 1\n", "", "schema"),
    ],
)
def test_a_value_of_the_wrong_type_is_refused(tmp_path: Path, old: str, new: str, field: str) -> None:
    assert field in refusal(write(tmp_path, old, new))


@pytest.mark.parametrize("text", ["not toml at all", "schema = 1\nschema = 1\n", "[a\n"])
def test_a_file_that_is_not_toml_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    assert "TOML" in refusal(path)


def test_a_binary_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(bytes(range(256)))
    refusal(path)


def test_an_unknown_specimen_is_answered_with_the_nearest() -> None:
    with pytest.raises(InputError) as refused:
        specimen("nylom")
    assert "Did you mean 'nylon'?" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not found"):
        specimen(tmp_path / "nowhere.toml")


def test_a_folder_of_specimens_is_read_and_a_bad_one_in_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path)
    monkeypatch.setenv("MCKIBBEN_SPECIMENS", str(tmp_path))
    assert "mine" in specimen_ids()
    folder = tmp_path / "more"
    folder.mkdir()
    write(folder, 'id = "mine"', 'id = "nylon"')  # a second nylon
    monkeypatch.setenv("MCKIBBEN_SPECIMENS", str(folder))
    with pytest.raises(InputError, match="another specimen has that id"):
        specimens()
    monkeypatch.setenv("MCKIBBEN_SPECIMENS", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="older not found"):
        specimens()


def test_a_shipped_specimen_is_found_in_the_file_of_its_name_as_among_all() -> None:
    # a single one is read without the others; its file is found by the id
    files = sorted(p.stem for p in (Path(mckibben.specimens.__file__).parent / "data").glob("*.toml"))
    assert sorted(s.id.lower() for s in specimens()) == files
    assert all(specimen(s.id) == s for s in specimens())


def test_what_no_source_prints_is_named_once_those_of_the_default_law_first():
    spec = specimen("nylon")
    named = spec.inferred()
    assert len(set(named)) == len(named)
    paths = {f"laws.{law}.{n}" for law, group in spec.laws.items() for n, p in group.items() if p.inferred}
    assert {path for path in named if path.startswith("laws.")} == paths and len({p.split(".")[1] for p in paths}) > 1
    own = [path.startswith(f"laws.{spec.law}.") for path in named if path.startswith("laws.")]
    assert own == sorted(own, reverse=True)
