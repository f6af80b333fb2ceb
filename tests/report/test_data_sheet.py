"""The data sheet of a muscle: one page, in the terms of makers' sheets, with the numbers of the law."""

import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib import get_data_path

from mckibben.errors import InputError
from mckibben.report import document_pdf
from mckibben.report.blocks import KeyValues, ReportTable, walk
from mckibben.report.study_reports import data_sheet
from mckibben.studies.description import describe_muscle


def blocks(name):
    found = describe_muscle(name)
    return found, [one for section in data_sheet(found).sections for one in walk(section.blocks)]


@pytest.mark.parametrize("name", ["nylon", "festo-10mm"])
def test_the_forces_of_a_sheet_are_those_of_the_law(name):
    found, parts = blocks(name)
    table = next(one for one in parts if isinstance(one, ReportTable))
    rest = found.specimen.property_si("rest_length", "m")
    pressures = [1e5 * float(column.title.split("\N{NO-BREAK SPACE}")[0]) for column in table.columns[1:]]
    for row in table.rows:
        share = float(str(row.cells[0]).split()[0]) / 100.0
        for cell, pressure in zip(row.cells[1:], pressures, strict=True):
            # the rounding of the printed value: two digits, or whole newtons
            law = float(np.asarray(found.law.tension((1.0 - share) * rest, pressure)))
            assert float(str(cell)) == pytest.approx(law, rel=0.05, abs=0.5)


def test_what_a_specimen_does_not_state_is_said_not_invented():
    _, parts = blocks("DMSP-20-300")
    pairs = dict(next(one for one in parts if isinstance(one, KeyValues)).pairs)
    assert pairs["Hysteresis"] == pairs["Leakage, shut off"] == pairs["Product weight"] == "not stated"
    assert math.isclose(float(pairs["Maximum contraction"].split()[0]), 26.7, abs_tol=0.1)


@pytest.mark.parametrize("name", ["nylon", "DMSP-20-300", "SM20"])
def test_a_sheet_is_one_page_in_html_and_pdf(name, tmp_path):
    typst = pytest.importorskip("typst")
    found = describe_muscle(name)
    files = document_pdf.sources(data_sheet(found))
    pages = typst.compile(files, format="png", font_paths=[str(Path(get_data_path()) / "fonts" / "ttf")], ppi=20)
    assert not isinstance(pages, list) or len(pages) == 1
    text = found.data_sheet(tmp_path / "sheet.html").read_text(encoding="utf-8")
    assert "Operating pressure" in text and found.data_sheet(tmp_path / "sheet.pdf").read_bytes().startswith(b"%PDF")


def test_a_biological_muscle_has_no_such_sheet(tmp_path):
    with pytest.raises(InputError, match="McKibben muscle"):
        describe_muscle("fast-fibre").data_sheet(tmp_path / "sheet.html")
