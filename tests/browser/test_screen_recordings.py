"""The page Recordings: what it shows is what the recordings hold, and what it does can be undone."""

import json
import os

import numpy as np
import pytest
from screen_figures import MOVED
from screen_server import says, settled

from mckibben.analysis.channels import find_cycles
from mckibben.analysis.loops import loops
from mckibben.recordings import Channel, Recording, read_any, read_recording


def made(folder, name, amplitude, meta=None):
    """A loop with friction: three cycles of a sine of the length."""
    t = np.arange(0.0, 3.0, 2e-3)
    length = 0.13 + amplitude * np.cos(2 * np.pi * t)
    tension = 900.0 * (length - 0.1) - 2.5 * np.sign(np.sin(2 * np.pi * t))
    channels = {"length": Channel(length, "m", "measured"), "tension": Channel(tension, "N", "measured"),
                "pressure": Channel(np.full(len(t), 5e5), "Pa", "measured")}  # fmt: skip
    about = {"title": f"Sine of {name}", "created": "2026-03-01T10:00:00", "protocol": {"name": "work-loop"}}
    Recording(t, channels, {**about, **(meta or {})}).save(folder / f"{name}.nc")


@pytest.fixture(scope="module")
def folder(served):
    served.folder.mkdir(parents=True, exist_ok=True)
    made(served.folder, "wide", 0.01)
    made(served.folder, "narrow", 0.004, {"specimen": "nylon"})
    made(
        served.folder,
        "odd",
        0.006,
        {"title": "<img src=x onerror=alert(1)>", "result": "tripped", "message": "pressure 6.01 bar"},
    )
    return served.folder


def line(page, name):
    return page.locator(f"tr[data-name='{name}.nc']")


def ready(page, count=3):
    page.wait_for_function(f"document.querySelectorAll('.rows tr .th svg').length >= {count}", timeout=60_000)


def test_two_clicks_overlay_two_recordings_with_the_numbers_of_the_analysis(visit, folder, until):
    page = visit("/recordings")
    ready(page)
    line(page, "wide").click()
    page.wait_for_selector("text=/Work per cycle/")
    line(page, "narrow").click()
    page.wait_for_function("document.querySelectorAll('[aria-label=\"Measured properties\"] th').length === 5")
    until(lambda: page.url.endswith("a=wide.nc&b=narrow.nc"))
    shown = page.eval_on_selector_all(
        "tbody tr:has-text('Work per cycle') td[data-value]", "all => all.map(c => +c.dataset.value)"
    )
    for value, name in zip(shown, ("wide", "narrow"), strict=True):  # exact: the same function on the same file
        assert value == -loops(read_recording(folder / f"{name}.nc"), length="length", tension="tension")[-1].area
    page.wait_for_selector("figure.chart canvas")
    spec = json.loads(page.locator("figure.chart").first.get_attribute("data-chart"))
    assert [one["label"] for one in spec["lines"]] == ["A", "B"] and [one["dash"] for one in spec["lines"]] == [
        "A",
        "B",
    ]
    other = visit("/recordings?a=wide.nc&b=narrow.nc&view=channels")  # the link restores it
    other.wait_for_function("document.querySelectorAll('figure.chart canvas').length === 3")
    until(lambda: line(other, "narrow").get_attribute("aria-selected") == "true")


CHARTS = "[...document.querySelectorAll('.overlay figure.chart')]"


def test_charts_loop_and_drawn_muscle_have_one_cursor_and_one_zoom(visit, folder, until):
    page = visit("/recordings?a=wide.nc")
    page.wait_for_selector(".timed .u-over")
    page.wait_for_selector(".player canvas")
    field = page.locator(".timed .u-over").last
    field.scroll_into_view_if_needed()
    box = field.bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.5 * box["height"])
    until(lambda: page.evaluate("typeof window.atCursor") == "number")
    at = page.evaluate("window.atCursor")
    record = read_recording(folder / "wide.nc")
    begins = record.time[find_cycles(record["length"])[0].start]
    there = int(np.searchsorted(record.time, at + begins))
    label = page.get_attribute(".player canvas", "aria-label")
    # of a sample beside the cursor, which moves the length by less than the last place that is said
    assert f"length {100 * record['length'][there]:.1f}" in label.replace("\u2212", "-")[:200] or any(
        f"length {100 * record['length'][i]:.2f} cm" in label for i in (there - 1, there)
    )
    # a zoom of one chart over time is that of the others, and the loop shows what was then
    other = visit("/recordings?a=wide.nc&view=channels")
    other.wait_for_function("document.querySelectorAll('figure.chart canvas').length === 3")
    box = other.locator(".timed .u-over").first.bounding_box()
    other.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"])
    tips = "[...document.querySelectorAll('.timed .tip')].map(t => t.hidden ? '' : t.textContent)"
    until(lambda: all(other.evaluate(tips)), what="a chart does not say what it has at the cursor")
    times = [float(tip.split("\u2009")[0].replace("\u2212", "-")) for tip in other.evaluate(tips)]
    # of the sample under the cursor: of 3 s over some hundred pixels, beside one of them
    assert np.ptp(times) <= 3.0 / box["width"] + 2e-3
    other.locator(".timed .plot").first.focus()
    other.keyboard.press("+")
    ranges = other.evaluate(f"{CHARTS}.map(f => (f.zoomed ?? f.whole).x)")
    assert all(one == ranges[0] for one in ranges) and other.evaluate(f"{CHARTS}.every(f => f.zoomed)")
    page.locator(".timed .plot").first.focus()
    before = page.evaluate(f"{CHARTS}[0].whole")
    for _ in range(6):
        page.keyboard.press("+")
    until(lambda: page.evaluate(f"{CHARTS}[0].whole") != before)
    page.keyboard.press("0")
    until(lambda: page.evaluate(f"{CHARTS}[0].whole") == before)


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (1024, 768), (768, 1024), (390, 844)])
def test_chosen_recordings_that_come_move_nothing_that_one_reads_already(visit, folder, width, height):
    page = visit("/recordings?a=wide.nc&b=narrow.nc", width=width, height=height)
    page.evaluate(MOVED)
    settled(page)
    assert page.evaluate("window.moved") < 0.1, page.evaluate("window.movers")  # what browsers call good


def test_a_recording_is_played_on_the_drawn_muscle_at_a_chosen_speed(visit, folder, until):
    page = visit("/recordings?a=wide.nc")
    page.wait_for_selector(".playbar button")
    page.get_by_label("Speed").select_option("2")
    first = page.get_attribute(".player canvas", "aria-label")
    began = page.evaluate("[+document.querySelector('.playbar input').value, performance.now()]")
    page.get_by_role("button", name="Play").click()
    until(lambda: page.evaluate("window.atCursor") > began[0] + 1.0)
    went = page.evaluate("[window.atCursor, performance.now()]")
    # faster it never goes; a busy machine draws late, never early
    assert went[0] - began[0] <= 2.0 * (went[1] - began[1]) / 1e3 + 0.01
    assert page.get_attribute(".player canvas", "aria-label") != first
    page.get_by_role("button", name="Hold").click()
    held = page.evaluate("window.atCursor")
    page.wait_for_timeout(200)
    assert page.evaluate("window.atCursor") == held
    page.get_by_label("Time", exact=True).fill("0.5")
    assert page.evaluate("window.atCursor") == pytest.approx(0.5, abs=2e-3)  # a step of the slider
    says(page, ".playbar output", f"{page.evaluate('window.atCursor'):.3f}")


def test_any_number_of_recordings_and_any_channel_are_overlaid_and_the_link_brings_them_back(visit, folder, until):
    record = read_recording(folder / "wide.nc")
    warm = {"muscle.temperature": Channel(np.linspace(293.0, 295.0, len(record)), "K", "true")}
    record.with_channels(warm).save(folder / "warm.nc")
    page = visit("/recordings")
    ready(page, 4)
    for name in ("wide", "narrow", "odd", "warm"):
        line(page, name).click()
    until(lambda: page.locator("[aria-label='Measured properties'] thead th").count() == 6)  # name, four, unit
    labels = "JSON.parse(document.querySelector('figure.chart').dataset.chart).lines.map(l => l.label)"
    assert page.evaluate(labels) == ["A", "B", "C", "D"] and page.locator(".player").count() == 4
    page.get_by_text("Other channels").click()
    page.get_by_label("muscle.temperature").check()
    until(lambda: "channels=muscle.temperature" in page.url)
    other = visit(page.url.removeprefix(page.url.split("/recordings")[0]))
    other.wait_for_selector("figcaption:has-text('muscle.temperature')")
    until(lambda: other.locator("tr[aria-selected=true]").count() == 4)
    line(page, "narrow").click()  # what is chosen is left by another click
    until(lambda: page.locator(".player").count() == 3)
    (folder / "warm.nc").unlink()


@pytest.mark.slow
def test_what_is_estimated_is_a_lane_with_its_interval_beside_the_sensor(visit, folder):
    record = read_recording(folder / "wide.nc")
    about = {"": 1e-4, ".low": -1e-3, ".high": 1e-3}
    ends = {f"estimated.length{end}": Channel(record["length"] + off, "m", "estimated") for end, off in about.items()}
    record.with_channels(ends).save(folder / "observed.nc")
    page = visit("/recordings?a=observed.nc&view=channels")
    page.wait_for_function("document.querySelectorAll('figure.chart canvas').length === 3")
    specs = [json.loads(one.get_attribute("data-chart")) for one in page.locator("figure.chart").all()]
    lanes = {spec["y"]["quantity"]: [(one["label"], one["fill"]) for one in spec["lines"]] for spec in specs}
    assert lanes == {"pressure": [("", False)], "length": [("", True), ("estimated", False), ("", False)],
                     "tension": [("", False)]}  # fmt: skip
    (folder / "observed.nc").unlink()


def test_a_chart_is_zoomed_by_wheel_keys_and_a_frame_saved_as_shown_and_whole_after_a_double_click(
    visit, folder, until
):
    page = visit("/recordings?a=wide.nc")
    field = page.locator("figure.chart .u-over").first
    field.wait_for()
    shown = "(({ x, y }) => x[1] - x[0])(document.querySelector('.plot').zoomer.now)"
    whole, box = page.evaluate(shown), field.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.wheel(0, -100)
    page.wait_for_timeout(100)
    assert page.evaluate(shown) == whole  # the wheel scrolls the page until the chart has the focus, or with Ctrl
    page.locator(".plot").first.focus()
    page.keyboard.press("+")
    assert page.evaluate(shown) == pytest.approx(whole / 1.25)  # the step of a key
    page.keyboard.down("Control")
    page.mouse.wheel(0, -100)
    page.keyboard.up("Control")
    until(lambda: page.evaluate(shown) < 0.7 * whole)
    begins = "document.querySelector('.plot').zoomer.now.x[0]"
    left = page.evaluate(begins)
    page.keyboard.press("Control+ArrowLeft")
    assert page.evaluate(begins) < left
    page.keyboard.down("Shift")
    page.mouse.down()
    page.mouse.move(x + 50, y + 30, steps=3)
    page.mouse.up()
    page.keyboard.up("Shift")
    until(lambda: page.evaluate(shown) < 0.2 * whole)
    page.locator(".savefig summary").first.click()
    with page.expect_download() as coming:
        page.locator(".savefig [data-format=svg]").first.click()
    text = coming.value.path().read_text(encoding="utf-8")
    assert coming.value.suggested_filename == "tension.svg" and "Tension, N" in text and "Length, cm" in text
    page.mouse.dblclick(x, y)
    until(lambda: page.evaluate(shown) == whole)


def test_recordings_are_listed_by_what_differs_and_their_loops_carry_the_value(visit, folder, until):
    for pressure in ("2 bar", "4 bar"):
        protocol = {"name": "sweep", "parameters": {"pressure": {"unit": "Pa", "value": pressure}}}
        made(folder, f"at {pressure}", 0.005, {"protocol": protocol})
    page = visit("/recordings?protocol=sweep&view=loops&differences=1")
    page.wait_for_selector("figure.chart canvas")
    until(lambda: page.locator(".rows small.apart").all_inner_texts() == ["pressure 4 bar", "pressure 2 bar"])
    assert "protocol sweep" in page.locator(".apart-bar").inner_text()
    lines = page.evaluate("JSON.parse(document.querySelector('figure.chart').dataset.chart).lines.map(l => l.label)")
    assert lines == ["2 bar", "4 bar"]
    for pressure in ("2 bar", "4 bar"):
        (folder / f"at {pressure}.nc").unlink()


def test_search_and_filters_leave_what_holds_the_words_and_text_of_a_file_is_never_markup(visit, folder, until):
    page = visit("/recordings")
    ready(page)
    page.fill("#search", "tripped 6.01")
    page.wait_for_selector("text=No recording matches")
    page.fill("#search", "6.01")
    page.wait_for_function("document.querySelectorAll('.rows tr').length === 1")
    assert "<img src=x" in line(page, "odd").inner_text() and page.locator("img").count() == 0
    other = visit(page.url.removeprefix(page.url.split("/recordings")[0]))
    ready(other, 1)
    until(lambda: other.locator(".rows tr").count() == 1)
    assert other.locator("#search").input_value() == "6.01"


def test_a_note_is_kept_in_the_file_and_can_be_undone(visit, folder, until):
    page = visit("/recordings?a=wide.nc")
    page.wait_for_selector("figure.chart canvas")
    page.keyboard.press("n")
    dialog = page.locator("dialog[open]")
    wide = read_recording(folder / "wide.nc")
    first = float(wide.time[find_cycles(wide["length"])[0].start])  # the axis begins at the first reversal
    dialog.get_by_label("Time").fill("99")
    dialog.get_by_label("Note", exact=True).fill("valve sounds rough here")
    dialog.get_by_role("button", name="Add note").click()
    dialog.locator(".err").wait_for()
    assert "time of a note must be between" in dialog.locator(".err").inner_text()
    assert dialog.get_by_label("Time").input_value() == "99"  # what was typed stays, to be put right
    dialog.get_by_label("Time").fill("1.25")
    dialog.get_by_role("button", name="Add note").click()
    page.wait_for_selector(".note-line:has-text('valve sounds rough here')")
    (note,) = read_recording(folder / "wide.nc").meta["notes"]
    assert note["text"] == "valve sounds rough here" and note["time"] == first + 1.25
    page.keyboard.press("Control+z")
    until(lambda: not read_recording(folder / "wide.nc").meta.get("notes"))


def test_a_deleted_recording_comes_back_and_a_renamed_one_keeps_its_kind(visit, folder, until):
    made(folder, "spare", 0.005)
    page = visit("/recordings?a=spare.nc")
    ready(page, 4)
    page.wait_for_selector("text=/Work per cycle/")
    page.keyboard.press("Delete")
    until(lambda: not (folder / "spare.nc").exists())
    page.wait_for_function("!document.querySelector(\"tr[data-name='spare.nc']\")")
    page.get_by_role("button", name="Undo").click()
    until(lambda: (folder / "spare.nc").exists())
    line(page, "spare").click()
    page.get_by_role("button", name="Rename").first.click()
    name = page.locator("dialog[open]").get_by_label("Name")
    name.fill("../away")
    name.press("Enter")
    page.wait_for_selector("dialog[open] .err:has-text('must be a plain name')")
    name.fill("kept")
    name.press("Enter")
    until(lambda: (folder / "kept.nc").exists() and not (folder / "spare.nc").exists())


@pytest.mark.parametrize("kind", ["CSV", "MAT"])
def test_an_exported_recording_reads_back_as_it_was(visit, folder, tmp_path, kind):
    page = visit("/recordings?a=narrow.nc")
    page.wait_for_selector("text=/Work per cycle/")
    page.get_by_role("group", name="Format").get_by_role("button", name=kind, exact=True).click()
    with page.expect_download(timeout=60_000) as coming:
        page.get_by_role("button", name="Export", exact=True).click()
    path = tmp_path / coming.value.suggested_filename
    coming.value.save_as(path)
    assert read_any(path).recording == read_recording(folder / "narrow.nc")


def test_a_file_of_others_is_taken_over_once_its_columns_are_named(visit, folder, until):
    page = visit("/recordings")
    ready(page)
    page.get_by_role("button", name="Import file").first.click()
    data = "t,load\n" + "\n".join(f"{i * 0.01:.2f},{10 + (i % 7)}" for i in range(50))
    page.set_input_files(
        "dialog[open] input[type=file]", {"name": "cell.csv", "mimeType": "text/csv", "buffer": data.encode()}
    )
    page.wait_for_selector("dialog[open] .err:has-text('no unit')")
    page.locator("dialog[open]").get_by_label("Units").fill("load=N")
    page.locator("dialog[open]").get_by_role("button", name="Import", exact=True).click()
    until(lambda: (folder / "cell.nc").exists())
    assert read_recording(folder / "cell.nc")["load"][3] == 13.0
    page.wait_for_selector("tr[data-name='cell.nc'].sel")


def test_what_a_file_leaves_open_is_asked_by_the_name_of_the_field_that_takes_it(visit, folder, until):
    page = visit("/recordings")
    ready(page)
    page.get_by_role("button", name="Import file").first.click()
    data = "t [ms];p [mbar]\n0;1.013\n10;1.113\n20;2.013\n"
    page.set_input_files(
        "dialog[open] input[type=file]", {"name": "marks.csv", "mimeType": "text/csv", "buffer": data.encode()}
    )
    page.wait_for_selector("dialog[open] .err:has-text('Say it under Decimal mark')")
    page.locator("dialog[open]").get_by_label("Decimal mark").fill(",")
    page.locator("dialog[open]").get_by_role("button", name="Import", exact=True).click()
    until(lambda: (folder / "marks.nc").exists())
    assert read_recording(folder / "marks.nc")["p"][0] == pytest.approx(101300.0, rel=1e-14)


def long_table(path, rows):
    """Lines of a table as a logger writes it, with a name that is not ASCII."""
    t = np.arange(rows) * 1e-3
    columns = (t, 130.0 + 10.0 * np.cos(6.2832 * t), 60.0 + 40.0 * np.sin(6.2832 * t))
    with open(path, "w") as stream:
        stream.write("time_s,length_mm,tension_N\n")
        for part in np.array_split(np.stack(columns, axis=1), max(1, rows // 100_000)):
            stream.write("\n".join(f"{a:.3f},{b:.5f},{c:.6f}" for a, b, c in part.tolist()) + "\n")
    return path


@pytest.mark.slow
def test_a_large_file_is_read_beside_the_server_and_can_be_stopped(visit, folder, tmp_path, until):
    path = long_table(tmp_path / "Kr\u00e4fte.csv", 600_000)  # 15 MB, read for seconds
    page = visit("/recordings")
    ready(page)
    page.get_by_role("button", name="Import file").first.click()
    page.set_input_files("dialog[open] input[type=file]", path)
    page.locator("dialog[open] .reading button", has_text="Stop reading").dispatch_event("click")
    page.wait_for_selector("dialog[open] .err:has-text('Reading was stopped.')")
    assert not (folder / "Kr\u00e4fte.nc").exists()
    page.locator("dialog[open]").get_by_role("button", name="Import", exact=True).click()
    until(lambda: (folder / "Kr\u00e4fte.nc").exists(), 60.0)
    assert len(read_recording(folder / "Kr\u00e4fte.nc")) == 600_000
    page.wait_for_selector("tr[data-name='Kr\u00e4fte.nc'].sel")


def resident(process):
    """Memory of a process [MB]."""
    with open(f"/proc/{process}/status") as stream:
        return next(int(line.split()[1]) / 1024.0 for line in stream if line.startswith("VmRSS"))


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="memory is looked up as Linux tells it")
def test_while_a_file_of_100_mb_is_read_stops_are_answered_all_the_time_and_memory_comes_back(
    visit, served, folder, tmp_path, until
):
    path = long_table(tmp_path / "long.csv", 3_600_000)
    bench, page = visit("/", control=True), visit("/recordings")
    bench.wait_for_function("window.lab.lab.status.by_hand === 'ready'", timeout=120_000)
    ready(page)
    stop = """async () => { await window.lab.act('emergency_stop', {reason: 'test'}); await window.lab.act('reset') }"""
    page.get_by_role("button", name="Import file").first.click()
    memory, stops = resident(served.process.pid), []
    page.set_input_files("dialog[open] input[type=file]", path)
    until(lambda: stops.append(bench.evaluate(stop)) or (folder / "long.nc").exists(), 240.0)
    # A server that reads by itself answers the first only when it has read. Reading takes some hundred times as long as
    # a stop, however busy the machine is; 20 leave a factor of ten for reading that is faster.
    assert len(stops) > 20
    page.wait_for_selector("tr[data-name='long.nc'].sel", timeout=120_000)
    page.wait_for_selector("text=/Work per cycle/", timeout=60_000)
    # one recording of 82 MB is shown, and what numpy and the page need besides
    assert resident(served.process.pid) - memory < 250.0
