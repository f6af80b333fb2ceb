"""``mckibben parts``: lists, one page per name, JSON in SI and a table for other programs."""

import csv
import json

import pytest

from mckibben.cli import main
from mckibben.studies.parts import list_parts, rows_of


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["parts", *words])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


@pytest.mark.usefixtures("shipped_kinds")
def test_the_lists_name_every_part_with_units(run):
    code, out, err = run()
    assert code == 0 and err == ""
    assert all(one.id in out for one in list_parts())
    assert "nominal flow, l/min" in out and "inside, mm" in out and "* inferred" in out


def test_a_filter_leaves_what_passes(run):
    code, out, _ = run("valves", "--min-flow", "500 l/min", "--json")
    assert code == 0 and [one["id"] for one in json.loads(out)["parts"]] == ["MPYE-5-1-4", "MPYE-5-1-8-HF"]


def test_a_name_shows_its_numbers_with_source_and_range(run):
    code, out, _ = run("compressor-small")
    assert code == 0 and "0.15 to 0.6" in out and "inferred" in out and "Its name can be used in" in out


def test_the_table_has_every_number_in_si(run, tmp_path):
    path = tmp_path / "parts.csv"
    code, out, _ = run("tubes", "--out", str(path))
    assert code == 0 and f"Written: {path}" in out
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    stated = rows_of(list_parts("tubes"))
    assert [r["part"] for r in rows] == [r["part"] for r in stated]
    assert [float(r["value"]) for r in rows] == [r["value"] for r in stated]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("MHE2-3-3",), "Unknown part 'MHE2-3-3'. Did you mean 'MHE2-3-2'"),
        (("valves", "--min-flow", "100"), "unit is missing"),
        (("valves", "--min-flow", "2 bar"), "--min-flow"),
        (("valves", "--max-mass", "3 m"), "--max-mass"),
        (("--out", "parts.pdf"), "--out"),
    ],
)
def test_bad_input_is_one_line_and_two(run, words, says):
    code, out, err = run(*words)
    assert code == 2 and out == "" and err.count("\n") == 1 and says in err
