"""The comparison: the table of the command line, recordings, links, bad input, a point's value."""

import asyncio
import csv
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from screen_server import says

from loops import completed
from mckibben.bench.run import run
from mckibben.recordings import Channel, Recording, read_recording
from mckibben.specimens import specimen
from mckibben.studies.comparison import MuscleTable, compare, subject
from mckibben.studies.comparison.table import PROPERTIES, MuscleColumn, column_of
from mckibben.web.elements import PageDocument
from mckibben.web.pages.compare import Compared, ComparePage, _short
from mckibben.web.pages.compare.drawings import exported
from mckibben.web.shelf import Shelf
from mckibben.web.workspace import RECORDINGS

LONG = 180_000  # a law is compiled once [ms]


def opened(visit, query, **options):
    page = visit(f"/compare?{query}", **options)
    page.wait_for_selector(".cmp .r", timeout=LONG)
    page.wait_for_function("!document.querySelector('.cmp .loading')", timeout=LONG)  # columns come one by one
    return page


@pytest.mark.slow
def test_the_exported_table_is_that_of_the_command_line_to_the_last_digit(visit):
    page = opened(visit, "muscles=nylon,fast-fibre")
    with page.expect_download() as waiting:
        page.get_by_role("button", name="Export table").click()
    with open(waiting.value.path(), newline="") as file:
        rows = [r for r in csv.reader(file) if not r[0].startswith("#")]
    assert rows[0][3:5] == ["nylon", "fast-fibre"]
    expected = compare(["nylon", "fast-fibre"]).properties()
    assert [r[1] for r in rows[1:]] == [row.property.name for row in expected]
    for line, row in zip(rows[1:], expected, strict=True):
        assert [float(w) if w else None for w in line[3:5]] == row.shown(), line[1]
    shown = page.locator(".cmp .r b").all_inner_texts()
    tension = next(r for r in expected if r.property.name == "maximum_tension").shown()
    assert {f"{v:.3g}" for v in tension} <= set(shown)


def test_two_biological_muscles_are_told_apart_by_their_fibres():
    titles = [specimen(name).title for name in ("fast-fibre", "slow-fibre", "nylon")]
    assert [_short(title) for title in titles] == ["Fast fibres", "Slow fibres", "Nylon shell muscle"]


def test_a_column_is_shown_as_soon_as_it_is_there_beside_those_that_are_not(monkeypatch, tmp_path):
    begun, may_end = threading.Event(), threading.Event()

    def column(page, name):
        if name == "fiberglass":
            begun.set()
            assert may_end.wait(20.0)
        return Compared(name, said=f"{name} is refused")

    monkeypatch.setattr(ComparePage, "_by_law", column)
    workspace = SimpleNamespace(recordings=Shelf(tmp_path, RECORDINGS), specimens=Shelf(tmp_path, (".toml",)))

    async def go():
        document = PageDocument()
        with document.root:
            page = ComparePage(workspace, {"muscles": "nylon,fiberglass"})
            page.build()
            assert await asyncio.to_thread(begun.wait, 20.0)
            shown = page.main.html()
            assert shown.count("nylon is refused") == shown.count("Computing") == 1 and ">fiberglass<" in shown
            may_end.set()
            while page.table is None:
                await asyncio.sleep(0.01)
            assert "Computing" not in page.main.html()

    completed(asyncio.wait_for(go(), 60.0))


def test_no_name_becomes_a_formula_of_a_spreadsheet():
    names = ["nylon", "=1+1", "@SUM(A1)", "-2", "+3", "\t=4"]
    columns = tuple(MuscleColumn(n, n, "law", {"maximum_tension": 1.0}, (f"of {n}",)) for n in names)
    rows = list(csv.reader(exported(MuscleTable(columns, {})).decode().splitlines()))
    assert rows[0][3 : 3 + len(names)] == ["nylon", *(f"'{n}" for n in names[1:])]
    assert all(cell[:1] not in "=+@\t" for row in rows for cell in row if cell)


def test_a_pressure_at_which_nothing_pulls_is_refused_in_the_commands_words(visit):
    page = opened(visit, "muscles=nylon")
    field = page.locator(".full-drive input")
    field.fill("0.5")
    field.press("Enter")
    sentence = "nylon pulls nothing at its rest length of 14 cm; choose a higher one"
    says(page, ".full-drive", sentence, "The old value, 5, stays in use.", longest=60.0)
    assert "pressure=" not in page.url


def test_a_link_restores_muscles_and_pressure_and_what_it_cannot_show_says_why(visit, until):
    page = opened(visit, "muscles=nylon,no-such,../../etc/passwd.toml&pressure=4 bar")
    assert page.locator(".full-drive input").input_value() == "4"
    until(lambda: page.locator(".ch").count() == 3)
    refused = page.locator(".cmp .err")
    until(lambda: refused.count() == 2)
    assert "must be a plain name" in refused.nth(1).inner_text()
    f0 = subject("nylon", pressure=4e5).full_tension
    assert f0 > 50.0
    until(lambda: page.locator(".surface").count() == 1)


def test_recordings_are_compared_by_what_they_say(visit, served, until):
    angle = 2.0 * np.pi * np.arange(0.0, 3.0, 0.01)
    length = 0.13 - 0.01 * np.cos(angle)
    tension = 30.0 + 2e3 * (length - 0.12) + 2.5 * np.sign(np.sin(angle))
    served.folder.mkdir(parents=True, exist_ok=True)
    path = served.folder / "loop.nc"
    channels = {
        "length": Channel(length, "m", "measured", "length"),
        "tension": Channel(tension, "N", "measured", "pull"),
    }
    Recording(angle / 2.0 / np.pi, channels, {"title": "a loop", "rest_length": 0.14}).save(path)
    page = opened(visit, "muscles=fast-fibre")
    page.get_by_role("button", name="From recordings").click()
    page.locator(".ch", has_text="loop").wait_for(timeout=LONG)
    expected = column_of(path)
    for name in ("maximum_tension", "maximum_velocity", "coulomb_friction"):
        shown = f"{PROPERTIES[name].shown(expected.values[name]):.3g}"
        row = page.locator(".k.r", has_text=PROPERTIES[name].title)
        assert row.locator("xpath=following-sibling::div[1]").locator("b").inner_text() == shown
    until(lambda: "values=recordings" in page.url and "recordings=loop.nc" in page.url)


def test_the_arrows_tell_a_points_tension_per_section(visit, until):
    page = opened(visit, "muscles=nylon")
    page.locator(".surface").focus()
    page.keyboard.press("ArrowRight")
    one = subject("nylon")
    most = float(one.tension(one.upper_length / one.rest_length)) * one.full_tension / one.section_area / 1e4
    tip = page.locator(".surface .tip")
    until(lambda: tip.inner_text().startswith(f"{most:.1f}"))
    page.keyboard.press("ArrowDown")
    until(lambda: "4.5" in tip.inner_text())


def test_a_stimulated_fibre_pulls_as_by_the_command_and_is_recorded(visit, served, until):
    page = opened(visit, "muscles=fast-fibre")
    width = page.locator(".stimulation").get_by_label("Width", exact=True)
    width.fill("-9")
    width.press("Tab")
    says(page, ".stimulation", "width must be between", "The old value stays in use.")
    width.fill("9")
    width.press("Tab")
    page.get_by_role("button", name="Stimulate").click()
    page.locator(".stimulation-result a").wait_for(timeout=LONG)
    (twitch,) = run("twitch", muscle="fast-fibre", width="9 ms").stimulated_contractions()
    shown = page.locator(".stimulation-result td").all_inner_texts()
    assert float(shown[1]) == pytest.approx(twitch.peak, rel=1e-3)  # four digits are shown
    name = page.locator(".stimulation-result a").inner_text()
    (kept,) = read_recording(served.folder / name).stimulated_contractions()
    assert kept.peak == twitch.peak


def test_only_biological_muscles_are_stimulated(visit):
    page = opened(visit, "muscles=nylon")
    assert page.locator(".stimulation").is_hidden()


def test_a_link_of_the_bench_to_a_biological_muscle_leads_to_the_comparison(visit):
    page = visit("/?muscle=fast-fibre", control=True)
    page.locator(".toast a").click()
    page.wait_for_url("**/compare?muscles=fast-fibre*")
    page.locator(".ch", has_text="Fast fibres").wait_for(timeout=LONG)
