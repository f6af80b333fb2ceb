"""The page The paper in a real Chromium: the rows of the command line, filters, figures, a run that can be stopped."""

import json
import multiprocessing
import os
import subprocess
import sys
import threading

import pytest
from screen_server import says
from typer.testing import CliRunner

from mckibben.cli.app import app
from mckibben_papers.rows import all_rows

LONG = 180_000  # a process starts and compiles meanwhile [ms]
QUICK = ("static.zero_force_angle", "static.stiffness_5bar", "energy.maximal.efficiency_accumulator")


def open_page(visit, query="", **options):
    page = visit(f"/paper{query}", **options)
    page.wait_for_selector(".p-root tr.g", timeout=LONG)
    return page


def row(name):
    return f'.p-root tr[data-row="{name}"]'


@pytest.mark.slow
def test_a_row_is_computed_as_the_command_does_and_shows_its_figure(visit):
    """Exact: another process computes the same function of the same numbers."""
    name = QUICK[2]
    found = CliRunner().invoke(app, ["reproduce", "--row", name, "--json"])
    (theirs,) = json.loads(found.stdout)["rows"]
    headline = json.loads(found.stdout)["headline"]
    assert headline == "1 printed number: 1 is a misprint, none falls short."
    page = open_page(visit)
    page.click(row(name))
    page.click("text=Compute this row")
    page.wait_for_selector(f"{row(name)}[data-value]", timeout=LONG)
    assert float(page.get_attribute(row(name), "data-value")) == theirs["ours"]
    assert page.get_attribute(row(name), "data-verdict") == theirs["verdict"] == "misprint"
    assert page.inner_text(f"{row(name)} s") == "0.49"  # theirs is struck out
    says(page, ".p-headline", headline)
    says(page, ".p-count[data-only=misprint]", "1", "are misprints")
    page.wait_for_selector(".p-svg svg", timeout=LONG)
    says(page, ".p-body .note", "Misprint. 0.470 from unrounded joules")
    page.click("text=Its numbers")
    assert page.locator(".p-numbers .sel s").inner_text() == "0.49"


def test_a_row_with_a_wide_tolerance_says_why_before_it_is_computed(visit):
    name = "table1.bridgestone.work_density"
    page = open_page(visit, f"?row={name}")
    assert "tolerance 5 %: the print divides 31 by the area" in page.get_attribute(f"{row(name)} .notecell", "title")
    says(page, ".p-body", "tolerance 5 %: the print divides 31 by the area")


@pytest.mark.slow
def test_filters_and_a_chosen_row_stand_in_the_link(visit, until):
    page = open_page(visit)
    rows = ".p-root tr[data-row]"
    until(lambda: page.locator(rows).count() == len(all_rows()))
    page.click(".p-count[data-only=misprint]")
    wrong = [r.id for r in all_rows() if r.expect == "erratum"]
    until(lambda: page.locator(rows).evaluate_all("all => all.map(a => a.dataset.row)") == wrong)
    page.keyboard.press("/")
    page.keyboard.type("accumulator")
    page.click(row(QUICK[2]))
    page.wait_for_function("location.search.includes('row=') && location.search.includes('search=accumulator')")
    url = page.evaluate("location.href")
    other = open_page(visit, url[url.index("?") :])
    assert other.get_attribute(row(QUICK[2]), "aria-selected") == "true"
    until(lambda: other.locator(rows).count() == 1)
    assert other.input_value(".p-search input") == "accumulator"
    says(other, ".p-figure h2", "Fig. 12")
    other.fill(".p-search input", "<b>nothing</b>")
    other.click("text=Show all rows")
    until(lambda: other.locator(rows).count() == len(all_rows()))


@pytest.mark.slow
def test_a_run_is_seen_by_all_and_what_was_computed_stays_when_it_is_stopped(visit):
    # on a narrow screen one part is open: that of the row in the link
    page, other = open_page(visit), open_page(visit, f"?row={QUICK[0]}", width=390, height=844)
    page.click("text=Run all")
    page.wait_for_selector(f"{row(QUICK[0])}[data-value]", timeout=LONG)
    other.wait_for_selector(f"{row(QUICK[0])}[data-value]", timeout=LONG)
    assert other.evaluate("document.documentElement.scrollWidth") <= 390
    page.locator("button.btn:visible", has_text="Stop").click()
    page.locator("button.btn:visible", has_text="Run all").wait_for(timeout=LONG)
    assert page.locator(f"{row(QUICK[0])}[data-value]").count() == 1
    says(page, ".p-progress", "rows are to come")


def test_a_row_and_a_figure_that_there_are_not_are_refused(visit):
    page = open_page(visit, "?row=nothing&figure=%3Cscript%3E")
    says(page, ".p-under", "row is 'nothing'", "Unknown figure '<script>'. Known are 1, 2, 3a")


@pytest.mark.slow
@pytest.mark.parametrize(("press", "option"), [("Run without recordings", ["--no-recordings"]), ("Run all", [])])
def test_all_rows_and_the_report_are_those_of_the_command(visit, tmp_path, press, option):
    words = [sys.executable, "-m", "mckibben", "reproduce", "--json", *option]
    done = subprocess.run(words, capture_output=True, text=True, timeout=1800, env=dict(os.environ), cwd=tmp_path)
    theirs = {r["id"]: r for r in json.loads(done.stdout)["rows"]}
    page = open_page(visit)
    page.click(f"text={press}")
    page.wait_for_function(
        f"document.querySelectorAll('.p-root tr[data-value]').length >= {len(theirs)}", timeout=1_800_000
    )
    for name, one in theirs.items():
        assert float(page.get_attribute(row(name), "data-value")) == one["ours"], name
        assert page.get_attribute(f"{row(name)}", "data-verdict") is not None
    with page.expect_download(timeout=600_000) as coming:
        page.click("text=Report as HTML")
    text = (tmp_path / "report.html").resolve()
    coming.value.save_as(text)
    report = text.read_text(encoding="utf-8")
    assert "The papers, reproduced" in report and report.count("<svg") > 20


def test_a_recording_whose_maker_was_stopped_is_made_again(tmp_path):
    """A claim that a process left behind keeps nobody waiting, and one that was made is read and not made again."""
    import numpy as np

    from mckibben.recordings import Channel, Recording
    from mckibben_papers.page.jobs import RecordingCache

    made = []

    def make():
        made.append(1)
        return Recording(np.arange(3.0), {"pressure": Channel(np.arange(3.0), "Pa", "measured")}, {})

    hold = "import sys, time; from mckibben.documents import locked\n"
    hold += "with locked(sys.argv[1]) as held: print(held, flush=True); time.sleep(99)"
    waited = []
    kept = RecordingCache(tmp_path, waited.append)
    kept.one("a", make)
    (file,) = tmp_path.glob("*.nc")
    file.unlink()
    maker = subprocess.Popen([sys.executable, "-c", hold, file.with_suffix(".lock")], stdout=subprocess.PIPE, text=True)
    assert maker.stdout.readline() == "True\n"
    threading.Timer(0.2, maker.kill).start()
    found = [kept.one("a", make) for _ in range(2)]
    maker.communicate()
    assert waited and len(made) == 2
    assert all(np.array_equal(r["pressure"], np.arange(3.0)) for r in found)


@pytest.mark.parametrize("begun", [False, True])
def test_a_worker_that_is_closed_refuses_what_waits_and_starts_no_process_for_it(tmp_path, until, begun):
    """Else the queue begins a new process while the server ends, which finds nobody to tell it what to do."""
    from mckibben_papers.page.jobs import STOPPED, WorkerProcess

    def children():
        return [child for child in multiprocessing.active_children() if child.name == "paper"]

    names, answers = ("1", "2", "3a"), []
    worker = WorkerProcess(str(tmp_path))
    for name in names:
        worker.ask(("figure", name), lambda *answer, of=name: answers.append((of, *answer)))
    if begun:
        until(children)
    worker.close()
    worker.ask(("figure", "4"), lambda *answer: answers.append(("4", *answer)))
    assert sorted(answers) == [(name, "refused", STOPPED) for name in (*names, "4")]
    assert not children() and "paper" not in [thread.name for thread in threading.enumerate()]
