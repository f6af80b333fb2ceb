"""The page Fit: a file that is dropped gives what the command gives, to the last bit, and what is wrong stands beside it."""

import json
import os
import re
import shutil
import subprocess
import sys
from importlib import resources

import pytest
from screen_server import says

from mckibben import muscle
from mckibben.muscles.laws import LAWS

MAP = resources.files("mckibben.specimens") / "maps" / "DMSP-20-300_force_map.csv"
FEW = "ideal,linear_threshold"  # two laws that are soon fitted
DONE = "document.querySelectorAll('.rank tr.pick').length === {n} && !document.querySelector('.going')"
LONG = 180_000  # a slow machine compiles every law [ms]
DROPPED = """([name, text]) => { const dataTransfer = new DataTransfer(); dataTransfer.items.add(new File([text], name))
    const drop = new DragEvent('drop', { dataTransfer, bubbles: true, cancelable: true })
    document.querySelector('[data-takes]').dispatchEvent(drop) }"""


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "map.csv"
    shutil.copy(MAP, path)
    return path


@pytest.fixture(scope="module")
def commanded(table):
    """What the command says of the same file."""
    words = [sys.executable, "-m", "mckibben", "fit", table.name, "--law", "ideal", "--law", "linear_threshold"]
    words += ["--rest-length", "30 cm", "--out", "map-fit.toml", "--json"]
    done = subprocess.run(words, cwd=table.parent, capture_output=True, text=True, timeout=300, env={**os.environ})
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), (table.parent / "map-fit.toml").read_text()


def rows(page):
    found = page.eval_on_selector_all(".rank tbody tr", "all => all.map(r => ({...r.dataset}))")
    return [r for r in found if r["law"]]


def fitted(page, count):
    page.wait_for_function(DONE.format(n=count), timeout=LONG)


def test_a_dropped_file_gives_the_same_ranking_parameters_and_specimen_file_as_the_command(visit, table, commanded):
    said, saved = commanded
    page = visit(f"/fit?laws={FEW}")
    page.wait_for_selector("text=Or use a published map")
    page.set_input_files("input[type=file]", table)
    page.fill("#c-rest", "30")  # in the unit that stands beside the field
    page.press("#c-rest", "Enter")
    page.wait_for_url("**rest=30*")
    page.fill("#c-rest", "300 mm")
    page.press("#c-rest", "Enter")
    page.wait_for_function("document.querySelector('#c-rest').value === '30'")  # as its unit beside it says, once
    page.fill("#c-rest", "30 cm")
    page.press("#c-rest", "Enter")
    page.wait_for_function("document.querySelector('#c-rest').value === '30'")
    page.wait_for_url("**rest=30*")
    fitted(page, 2)
    shown = rows(page)
    assert [r["law"] for r in shown] == [f["law"] for f in said["fits"]]
    for row, fit in zip(shown, said["fits"], strict=True):  # exact: the same function on the same file
        assert float(row["rmse"]) == fit["rmse"] and float(row["most"]) == fit["max_error"]
        assert float(row["left"]) == fit["left_out_rmse"] and float(row["aicc"]) == fit["aicc"]
    for fit in said["fits"]:
        page.click(f".rank tr[data-law={fit['law']}]")
        for name, estimate in fit["parameters"].items():
            cell = page.locator(f".par tr[data-parameter={name}][data-value='{estimate['value']!r}']")
            cell.wait_for()
            assert float(cell.get_attribute("data-low")) == estimate["low"]
            assert float(cell.get_attribute("data-high")) == estimate["high"]
    with page.expect_download() as coming:
        page.get_by_role("button", name="Save as specimen file").click()
    assert coming.value.path().read_text(encoding="utf-8") == saved


def test_a_link_restores_table_laws_and_view_and_a_report_opens(visit, table, commanded, served, until):
    shutil.copytree(table.parent, served.folder / "uploads", dirs_exist_ok=True)
    page = visit(f"/fit?table=map.csv&rest=30+cm&laws={FEW}&law=ideal&view=surface")
    fitted(page, 2)
    page.wait_for_selector("figure[data-kind=surface] svg")
    assert page.locator(".rank tr.sel").get_attribute("data-law") == "ideal"
    assert page.locator("#c-rest").input_value() == "30"
    until(lambda: page.locator(".law input:checked").count() == 2)
    page.get_by_role("button", name="Residuals").click()
    page.wait_for_selector("figure[data-kind=errors] svg")
    until(lambda: "view=errors" in page.url)
    with page.context.expect_page() as coming:
        page.get_by_role("button", name="Open report").click()
    coming.value.wait_for_function("() => document.title.startsWith('Tension laws fitted')", timeout=60_000)
    coming.value.close()
    page.evaluate("window.lab.act('ask_control')")
    until(lambda: page.evaluate("window.lab.lab.status.holder === window.lab.lab.page"))
    page.get_by_role("button", name="Use on the bench").click()
    page.wait_for_url("**/?muscle=map-fit*")
    muscle = re.search(r"muscle=([\w-]+)", page.url)[1]  # beside one of this name that an earlier visitor saved, if any
    page.wait_for_function(f"window.lab?.lab.parts.setup?.muscle === '{muscle}'")
    of = f"window.lab.lab.parts.setup.muscles.find(m => m.id === '{muscle}')"
    assert page.evaluate(f"{of}.law") == "ideal"  # the one that was shown


def test_a_travel_of_a_testing_machine_is_chosen_as_one_and_counts_from_the_rest_length(visit):
    rows = [(way, bar * (50 - 2 * way), bar) for bar in (2, 4) for way in (0, 5, 10, 15)]
    table = "\n".join(["Weg;Kraft [N];Druck [bar]", *(";".join(map(str, row)) for row in rows)])
    page = visit("/fit?laws=ideal")
    page.wait_for_selector("[data-takes] input[type=file]", state="attached")
    page.evaluate(DROPPED, ["zug.csv", table])
    page.get_by_label("What Weg holds").select_option(label="Contraction or travel")
    page.get_by_label("Unit of Contraction or travel").select_option("mm")
    page.fill("#c-rest", "30")
    page.press("#c-rest", "Enter")
    page.wait_for_selector("text=8 rows used")
    fitted(page, 1)
    page.wait_for_selector("figure.fitplot[data-fit]", state="attached")
    lengths = page.evaluate("JSON.parse(document.querySelector('figure.fitplot').dataset.fit).points.map(p => p.L)")
    assert sorted(set(lengths)) == [28.5, 29.0, 29.5, 30.0]


def test_a_law_that_ended_at_a_bound_says_so_where_it_stands_and_comes_behind_the_law_that_it_then_is(visit):
    braid = muscle("ideal", thread_length="16 cm", turns=3.2)  # a braid without a wall
    rows = [
        (cm, bar, float(braid.tension(cm / 100.0, bar * 1e5))) for bar in (1, 2, 3, 4) for cm in (11, 11.5, 12, 12.5)
    ]
    table = "\n".join(["length [cm],pressure [bar],force [N]", *(",".join(map(repr, row)) for row in rows)])
    page = visit("/fit?laws=thick_wall,ideal&rest=14")
    page.wait_for_selector("[data-takes] input[type=file]", state="attached")
    page.evaluate(DROPPED, ["braid.csv", table])
    fitted(page, 2)
    first, second = page.locator(".rank tr.pick").all()
    assert (first.get_attribute("data-law"), second.get_attribute("data-law")) == ("ideal", "thick_wall")
    assert "wall_thickness at its bound" in second.inner_text() and "bound" not in first.inner_text()


@pytest.mark.slow
def test_columns_without_names_are_mapped_by_hand_and_what_is_wrong_stands_beside_them(visit, tmp_path):
    path = tmp_path / "unnamed.csv"
    lines = MAP.read_text().splitlines()
    path.write_text("\n".join(["way,air [kPa],load", *lines[1:]]))
    page = visit("/fit?laws=ideal")
    page.wait_for_selector("[data-takes] input[type=file]", state="attached")
    page.evaluate(DROPPED, [path.name, path.read_text()])
    wrong = page.locator(".fit .stack .err")
    wrong.wait_for()
    assert "pressure is missing: the file has way, air [kPa], load" in wrong.inner_text()
    assert "unnamed.csv" in wrong.inner_text() and "/" not in wrong.inner_text()  # nothing of the machine's folders
    for i, what in enumerate(("length", "pressure", "tension")):
        page.locator(".map select[aria-label^='What']").nth(i).select_option(what)
        page.wait_for_url(f"**{what}**")
    page.wait_for_selector("text=way has no unit")
    assert page.locator(".map .field.bad select[aria-invalid=true]").count() == 1  # the column that is to blame
    page.locator("select[aria-label='Unit of Length']").select_option("m")
    page.wait_for_selector("text=load has no unit")
    page.locator("select[aria-label='Unit of Tension']").select_option("N")
    # 65000 kPa is no muscle: the header is wrong, and the sentence says so
    page.wait_for_selector("text=wrong unit, or columns swapped?")
    page.locator("select[aria-label='Unit of Pressure']").select_option("Pa")
    page.wait_for_selector("text=60 rows used. 66 rows read zero tension")
    fitted(page, 1)


def test_a_spreadsheet_of_several_sheets_asks_which_one_is_meant(visit, tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for name, rows in (("first", 12), ("second", 7)):
        sheet = book.create_sheet(name)
        for line in MAP.read_text().splitlines()[: rows + 1]:
            sheet.append([float(cell) if cell[0].isdigit() else cell for cell in line.split(",")])
    book.save(tmp_path / "two.xlsx")
    page = visit("/fit?laws=ideal")
    page.wait_for_selector("text=Or use a published map")
    page.set_input_files("input[type=file]", tmp_path / "two.xlsx")
    page.wait_for_selector("text=12 rows, ")
    page.locator("select[aria-label=Sheet]").select_option("second")
    page.wait_for_selector("text=7 rows, ")
    page.wait_for_url("**part=second*")


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("pump.exe", b"MZ", "another ending"),
        ("broken.mat", b"MATLAB 5.0 MAT-file" + b"\x07" * 300, "cannot be read as a MATLAB file"),
        ("<img src=x onerror=alert(1)>.csv", b"length_m,pressure_bar,force_N\n0.2,1,x\n", "img src-x onerror-alert(1).csv"),
    ],
)  # fmt: skip
def test_a_broken_or_foreign_file_is_refused_with_a_sentence(visit, tmp_path, name, data, said):
    page = visit("/fit?laws=ideal")
    page.wait_for_selector("text=Or use a published map")
    page.set_input_files("input[type=file]", {"name": name, "mimeType": "text/plain", "buffer": data})
    page.wait_for_selector(f".fit .err:has-text({json.dumps(said)})", timeout=60_000)
    assert page.locator("img").count() == 0


@pytest.mark.slow
def test_until_the_last_law_is_fitted_rows_stand_where_they_came_and_none_has_a_place(visit, table, served):
    shutil.copytree(table.parent, served.folder / "uploads", dirs_exist_ok=True)
    page = visit("/fit?table=map.csv&rest=29.8+cm")
    shown = """() => { const rows = [...document.querySelectorAll('.rank tr.pick')]
        const of = n => rows.map(r => r.children[n < 0 ? r.children.length - 1 : n].innerText)
        return document.querySelector('.going') && rows.length > 2 ? { laws: rows.map(r => r.dataset.law), places: of(0),
            distances: of(-1), said: document.querySelector('#preliminary').innerText } : null }"""
    seen = page.wait_for_function(shown, timeout=LONG).json_value()
    assert seen["laws"] == [law for law in LAWS if law in seen["laws"]]  # as they are listed, and fitted
    assert {*seen["places"], *seen["distances"]} == {"\N{EN DASH}"}
    assert re.fullmatch(rf"Preliminary: \d+ of {len(LAWS)} laws are fitted; .*", seen["said"])
    page.get_by_role("button", name="Stop fitting").click()
    says(page, "#preliminary", "Stopped: the places are those of")
    assert page.locator(".rank tr.pick td:first-child").first.inner_text() == "1"


def test_work_can_be_stopped_and_what_is_done_stays(visit, table, served):
    shutil.copytree(table.parent, served.folder / "uploads", dirs_exist_ok=True)
    page = visit("/fit?table=map.csv&rest=29.9+cm")
    page.get_by_role("button", name="Stop fitting").click()
    page.wait_for_function("!document.querySelector('.going')")
    page.wait_for_timeout(500)
    assert page.locator(".going").count() == 0  # nothing began it again
    assert page.evaluate("window.lab.lab.open")
