"""Reports on a narrow screen."""

import pytest

from mckibben.report.blocks import ReportTable, Section, TableColumn, TableRow
from mckibben.report.document import Document

PHONE = {"width": 390, "height": 844}


def test_a_table_of_names_and_three_numbers_is_read_on_a_phone_without_scrolling(chromium, tmp_path):
    numbers = (
        TableColumn("Value", number=True),
        TableColumn("95 %: from", number=True),
        TableColumn("to", number=True),
    )
    rows = (
        TableRow(
            ("law.stiffness_per_pressure", "0.1442\N{NO-BREAK SPACE}cm^2", "−3.926e−06\N{NO-BREAK SPACE}1/s", "50")
        ),
        TableRow(
            ("leak.decay", "2.005e−05\N{NO-BREAK SPACE}1/s", "3.926e−06\N{NO-BREAK SPACE}1/s", "1\N{NO-BREAK SPACE}N")
        ),
    )
    table = ReportTable((TableColumn("Parameter"), *numbers), rows, "Parameters")
    path = Document("A report", (Section("Result", (table,), "result"),)).write(tmp_path / "report.html")
    for size, below in ((PHONE, True), ({"width": 1280, "height": 900}, False)):
        page = chromium.new_page(viewport=size)
        page.goto(path.as_uri())
        box = page.locator(".scroll")
        assert box.evaluate("e => e.scrollWidth <= e.clientWidth")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        name, value = page.locator("tbody th").first, page.locator("tbody td").first
        assert (
            value.bounding_box()["y"] > name.bounding_box()["y"] + 5.0
        ) == below  # more than a difference of baselines
        ends = [
            [box["x"] + box["width"] for box in (cell.bounding_box() for cell in page.locator(which).all())]
            for which in ("thead th", "tbody td")
        ]
        # The numbers of a column end where its title does within two pixels, of equal shares beside padding.
        assert ends[0][1:] == pytest.approx(ends[1][:3], abs=2.0)
        page.close()
