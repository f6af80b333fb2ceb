"""The page Bench in a real Chromium: runs by clicks, stops, set-points by hand, watchers, refusals."""

import re
import subprocess
import sys

import numpy as np
import pytest
from screen_server import says

from mckibben.recordings import read_recording

SHORT = """schema = 1
name = "short"
title = "Short"
[parameters.high]
unit = "Pa"
value = "2 bar"
low = "0 bar"
high = "100 bar"
[[steps]]
label = "up"
pressure = { to = "$high", in = "0.3 s" }
span = { to = "13 cm", in = "0.3 s" }
[[steps]]
label = "cycles"
span = { kind = "sine", mean = "13 cm", amplitude = "0.5 cm", frequency = "2 Hz" }
cycles = 3
"""
LONG = SHORT.replace("cycles = 3", "cycles = 200").replace('name = "short"', 'name = "long"')


@pytest.fixture
def bench(visit, status, until):
    """A page in control of an idle bench with a protocol on it; the pace is as fast as it goes."""

    def go(text=SHORT, pace="simulated", **options):
        page = visit("/", control=True, **options)
        page.evaluate("window.lab.act('stop')")
        until(lambda: not status(page).get("running"))
        page.evaluate("window.lab.act('vent')")
        if status(page)["why"]:
            assert page.evaluate("window.lab.act('reset')")["ok"]
        # by the server: what a page knows may be older than the vent before
        asked = "window.lab.act('say', {line: 'status'}).then(a => a.said.text)"
        until(lambda: page.evaluate(asked).startswith("idle"))
        setup = "window.lab.lab.parts.setup"
        for part, usual in (("rig", "paper"), ("muscle", "nylon")):  # whatever a test before has chosen
            if page.evaluate(f"{setup}.{part}") != usual:
                assert page.evaluate(f"window.lab.act('{part}', {{name: '{usual}'}})")["ok"]
                until(lambda one=part, u=usual: page.evaluate(f"{setup}.{one}") == u)
        assert page.evaluate("([t]) => window.lab.act('text', {text: t})", [text])["ok"]
        name = re.search(r'name = "(\w+)"', text)[1]
        until(lambda: page.evaluate("window.lab.lab.parts.protocol?.name") == name)
        checked = "window.lab.act('say', {line: 'check'}).then(a => a.said.text)"
        until(lambda: "the dry run passes" in page.evaluate(checked), 60.0, "the dry run did not pass")
        until(lambda: page.evaluate("window.lab.lab.parts.dry?.passed === true"))
        page.evaluate("([p]) => window.lab.act('pace', {name: p})", [pace])
        return page

    yield go


def clicked(page, until, status, begun=0.0):
    """Start by a click, until samples come."""
    page.click("#start")
    until(lambda: status(page).get("running") and status(page)["time"] > begun, 60.0)


def files(served):
    return sorted(served.folder.glob("*.nc"))


@pytest.mark.slow
def test_a_run_by_clicks_is_the_recording_of_the_command_bit_for_bit_whatever_its_pace(
    bench, served, status, until, tmp_path
):
    page = bench(pace="slow")
    clicked(page, until, status, 0.02)
    page.click("#pause")
    until(lambda: status(page)["shape"] == "paused")
    samples = "window.lab.bench.buffer.n"

    def stands():
        """No sample in 300 ms, in which a run at this pace has thirty; those on the way come first."""
        before = page.evaluate(samples)
        page.wait_for_timeout(300)
        return page.evaluate(samples) == before

    until(stands, 10.0, "a paused run does not stand still")
    still = page.evaluate(samples)
    page.click("#step")
    until(lambda: page.evaluate(samples) == still + 1, what="one sample for one step")
    page.click("#resume")
    page.click("[data-pace=simulated]")
    until(lambda: not status(page).get("running"), 60.0)
    name = status(page)["ended"]["file"]
    ours = read_recording(served.folder / name)
    text = tmp_path / "short.toml"
    text.write_text(SHORT)
    out = tmp_path / "cli.nc"
    words = [sys.executable, "-m", "mckibben", "run", str(text), "--muscle", "nylon", "--real-time", "--out", str(out)]
    subprocess.run(words, check=True, capture_output=True, timeout=240)
    theirs = read_recording(out)
    assert ours.meta["result"] == theirs.meta["result"] == "done" and ours.meta["digest"] == theirs.meta["digest"]
    assert list(ours.channels) == list(theirs.channels) and np.array_equal(ours.time, theirs.time)
    for channel in ours.channels:
        assert np.array_equal(ours[channel], theirs[channel], equal_nan=True), channel
    assert ours.meta["parameters"] == theirs.meta["parameters"] and ours.meta["steps"] == theirs.meta["steps"]


@pytest.mark.parametrize("pace", [pytest.param("slow", marks=pytest.mark.slow), "real", "simulated"])
def test_escape_vents_within_100_ms_of_simulated_time_even_inside_a_field(bench, served, status, until, pace):
    page = bench(LONG, pace)
    clicked(page, until, status, 0.05 if pace == "slow" else 0.4)
    page.evaluate("""() => { window.at = null; addEventListener('keydown', e => {
        if (e.key === 'Escape') window.at = window.lab.bench.buffer.end }, true) }""")
    page.focus("#line")
    page.keyboard.press("Escape")
    until(lambda: status(page)["shape"] == "tripped" and not status(page).get("running"), 30.0)
    pressed = page.evaluate("window.at")
    says(page, ".top .estop", "Vented")
    record = read_recording(served.folder / status(page)["ended"]["file"])
    (event,) = [e for e in record.meta["events"] if e.get("code") == "emergency_stop"]
    assert 0.0 <= event["time"] - pressed <= 0.1, event["time"] - pressed
    after = record.time >= event["time"]
    assert record["valve.command"][after].max() == 0.0 and record["pressure"][-1] < 0.2e5
    assert page.evaluate("window.lab.act('reset')")["ok"]


def test_a_reload_during_a_run_finds_it_again(bench, served, status, until):
    page = bench(LONG, "slow")
    clicked(page, until, status, 0.1)
    epoch = page.evaluate("window.lab.bench.buffer.epoch")
    page.reload()
    page.wait_for_function("window.lab && window.lab.bench && window.lab.bench.buffer.n > 0")
    assert page.evaluate("window.lab.bench.buffer.epoch") == epoch
    assert page.evaluate("window.lab.bench.buffer.first") == 0  # what came before the reload is there again
    until(lambda: status(page).get("running") and status(page)["holder"] == page.evaluate("window.lab.lab.page"))
    page.keyboard.press("s")
    until(lambda: status(page)["shape"] == "idle", 30.0)
    says(page, "#log", "Stopped by you", "Recorded as long-")
    record = read_recording(served.folder / status(page)["ended"]["file"])
    assert record.meta["events"][-1]["code"] == "stop" and "emergency" not in record.meta["message"]


@pytest.mark.slow
def test_a_lost_line_turns_the_page_grey_and_fetches_what_was_missed(bench, status, until):
    page = bench(LONG, "slow")
    clicked(page, until, status, 0.05)
    page.evaluate("""() => { window.keep = WebSocket
        window.WebSocket = class { constructor () { setTimeout(() => this.onclose(), 10) } }; window.lab.drop() }""")
    says(page, "#state", "No connection")
    says(page, "#ban", "use the button on the machine")
    says(page, ".top .estop", "cannot reach the machine")
    until(lambda: page.evaluate("document.documentElement.classList.contains('old')"))
    seen = page.evaluate("window.lab.bench.buffer.n")
    page.wait_for_timeout(600)
    page.evaluate("() => { window.WebSocket = window.keep }")
    says(page, "#state", "Running")
    until(lambda: page.evaluate("window.lab.bench.buffer.n") > seen + 60)
    times = page.evaluate("Array.from(window.lab.bench.buffer.t.subarray(0, window.lab.bench.buffer.n))")
    assert np.allclose(np.diff(times), 1e-3, atol=1e-6)  # not a sample is missing
    page.click("#stop")
    until(lambda: not status(page).get("running"), 30.0)


def test_a_second_page_watches_and_may_stop_but_not_start(bench, visit, status, until):
    first = bench(LONG, "slow")
    clicked(first, until, status, 0.05)
    second = visit("/")
    second.wait_for_function("window.lab.bench && window.lab.bench.buffer.n > 20")
    says(second, "#who", "You watch")
    until(lambda: second.locator("#pause").is_disabled())
    second.click("#stop")
    until(lambda: not status(first).get("running"), 30.0)
    refused = second.evaluate("window.lab.act('start')")
    assert not refused["ok"] and "another page is in control" in refused["said"]


@pytest.mark.slow
def test_set_points_by_hand_move_the_machine_and_are_refused_in_the_words_of_the_rig(bench, status, until):
    page = bench(pace="real")
    until(lambda: status(page)["by_hand"] == "ready", 60.0)
    number = page.locator("#sliders .field input").first
    number.fill("1.5")
    number.press("Tab")
    until(lambda: abs(page.evaluate("window.lab.bench.buffer.latest('pressure')") - 1.5) < 0.1, 30.0)
    says(page, "#state", "By hand")
    number.fill("99")
    number.press("Tab")
    said = page.locator("#sliders .err").first
    until(lambda: said.is_visible())
    assert "99 bar" in said.inner_text().replace("\u2009\u2060", " ") and "by hand" in said.inner_text()
    page.click("#vent")
    until(lambda: status(page)["shape"] == "idle", 30.0)


@pytest.mark.slow
def test_when_the_page_in_control_vanishes_what_is_held_by_hand_is_held_for_5_s_and_then_vents(
    bench, visit, status, until
):
    page = bench(pace="real")
    until(lambda: status(page)["by_hand"] == "ready", 60.0)
    assert page.evaluate("window.lab.act('set', {pressure: '2 bar'})")["ok"]
    until(lambda: page.evaluate("window.lab.bench.buffer.latest('pressure')") > 1.9, 30.0)
    other = visit("/")
    other.wait_for_function("window.lab.bench?.buffer.n > 20")
    page.context.close()
    other.wait_for_timeout(2000)
    assert other.evaluate("window.lab.bench.buffer.latest('pressure')") > 1.8
    until(lambda: other.evaluate("window.lab.bench.buffer.latest('pressure')") < 0.1, 60.0)
    says(other, "#log", "nobody is in control: vented")


def test_a_number_of_the_sentence_is_its_field_and_says_beside_itself_what_is_wrong(bench, until):
    page = bench()
    page.locator("#sent button", has_text="bar").first.click()
    page.keyboard.type("300")
    page.keyboard.press("Enter")
    said = page.locator("#refused")
    until(lambda: "stays in use" in said.inner_text())
    assert "high must be between 0 bar and 100 bar" in said.inner_text().replace("\u2009\u2060", " ")
    page.locator("#sent button", has_text="bar").first.click()
    page.keyboard.type("3")
    page.keyboard.press("Enter")
    until(lambda: 'value = "3 bar"' in page.evaluate("window.lab.lab.parts.protocol?.text ?? ''"))


def test_a_number_that_is_opened_while_the_one_before_is_taken_keeps_what_is_typed(bench, until):
    page = bench()
    assert page.evaluate("window.lab.act('protocol', {name: 'work-loop'})")["ok"]
    page.wait_for_selector("#sent [data-name=cycles]")
    until(lambda: page.evaluate("window.lab.lab.parts.dry?.passed === true"))
    page.evaluate(
        """() => { const send = WebSocket.prototype.send
        WebSocket.prototype.send = function (words) { setTimeout(() => send.call(this, words), 500) } }"""
    )  # a slow line
    page.click("#sent [data-name=shortening]")
    page.keyboard.type("4 bar")
    page.keyboard.press("Enter")
    page.click("#sent [data-name=cycles]")
    page.keyboard.type("5")
    page.wait_for_timeout(1_500)  # meanwhile the first is taken
    page.keyboard.press("Enter")
    form = "Object.fromEntries(window.lab.lab.parts.protocol.form.map(f => [f.name, f.value]))"
    until(lambda: [page.evaluate(form)[name] for name in ("shortening", "cycles")] == ["4", "5"])


def test_a_dry_run_that_comes_while_somebody_types_changes_nothing_that_is_typed(bench, until):
    low = '[parameters.low]\nunit = "Pa"\nvalue = "0 bar"\n[[steps]]\nlabel = "wait"\n'
    low += 'pressure = { to = "$low", in = "0.1 s" }\n'
    page = bench(SHORT.replace("[[steps]]", f"{low}[[steps]]", 1))

    def checked_again():
        page.evaluate("() => { window.before = window.lab.lab.parts.dry; window.lab.act('dry_run') }")
        until(lambda: page.evaluate("(d => d !== window.before && !d.pending)(window.lab.lab.parts.dry)"))

    page.click("[data-face=form]")
    page.focus("#f-low")
    page.keyboard.press("ControlOrMeta+A")
    page.keyboard.type("0.2")
    checked_again()
    assert page.input_value("#f-low") == "0.2"
    page.keyboard.press("Tab")
    until(lambda: page.evaluate("window.lab.lab.parts.protocol.form.find(f => f.name === 'low').value") == "0.2")
    page.click("#save")
    page.fill("#save-as", "mine")
    checked_again()
    page.click("#save")
    says(page, "#ed-said", "Saved as mine.")
    checked_again()
    says(page, "#ed-said", "Saved as mine.")
    page.click("#ed-close")
    page.click("#sent button[data-name=high]")
    page.keyboard.type("3")
    checked_again()
    assert page.locator("#sent input").input_value() == "3"
    page.keyboard.press("Enter")
    until(lambda: page.evaluate("window.lab.lab.parts.protocol.form.find(f => f.name === 'high').value") == "3")


def test_nothing_starts_before_the_dry_run_has_passed_and_it_offers_the_cure(bench, until):
    page = bench()
    page.click("#faces [data-face=form]")
    page.fill("#f-high", "8")
    page.keyboard.press("Tab")
    until(lambda: page.evaluate("window.lab.lab.parts.dry?.passed === false"), 30.0)
    until(lambda: page.locator("#start").is_disabled())
    says(page, "#ed", "Nothing may start")
    says(page, "#ed .f .err", "regulator allows")
    page.click("#use")
    until(lambda: page.evaluate("window.lab.lab.parts.dry?.passed === true"), 30.0)
    page.fill("#ed-text", "schema = 1")
    says(page, "#ed-dry", "not taken yet")  # what has passed is the text before
    page.keyboard.press("Control+Enter")
    says(page, "#text-err", "name is")
    page.keyboard.press("Escape")
    until(lambda: not page.locator("#ed").is_visible())
    until(lambda: page.locator("#start").is_enabled())


@pytest.mark.slow
def test_own_data_1_newton_above_the_dry_run_leave_an_rms_of_1_newton_before_and_beside_a_run(bench, until, status):
    page = bench()
    curves = page.evaluate("window.lab.lab.parts.dry.curves")
    rows = [
        f"{t - 0.1:.6f},{100 * length:.6f},{tension + 1.0:.6f}"
        for t, length, tension in zip(curves["time"], curves["length"], curves["tension"], strict=True)
        if tension is not None
    ]
    table = "\n".join(["time [s],length [cm],force [N]", *rows])
    page.set_input_files("#own input[type=file]", {"name": "own.csv", "mimeType": "text/csv", "buffer": table.encode()})
    page.wait_for_selector("#own [data-rms=tension]")
    # the clock of the file is found to a hundredth of a second, in which the tension rises by a few tenths of a newton
    assert page.evaluate("window.lab.bench.strips.own.rms('tension').rms") == pytest.approx(1.0, abs=0.2)
    assert page.evaluate("window.lab.bench.strips.own.shift") == pytest.approx(0.1, abs=0.01)
    page.click("#start")
    until(lambda: status(page).get("ended", {}).get("file"), 60.0)
    until(lambda: "less the simulation" in page.locator("#own").inner_text())
    left = page.evaluate("window.lab.bench.strips.own.rms('tension')")
    assert left["n"] > 100 and 0.0 < left["rms"] < 20.0  # friction and delays, which the dry run leaves out
    with page.expect_download() as coming:
        page.click("#strips .savefig summary")
        page.click("#strips .savefig [data-format=svg]")
    assert "Residual, N" in coming.value.path().read_text(encoding="utf-8")


def test_a_script_in_a_label_is_a_label(bench):
    evil = SHORT.replace('label = "up"', 'label = "<img src=x onerror=window.harmed=1>"').replace(
        'title = "Short"', 'title = "<script>window.harmed=1</script>"'
    )
    page = bench(evil)
    page.click("#faces [data-face=text]")
    says(page, "#sent", "onerror=window.harmed")
    page.wait_for_timeout(500)
    assert page.evaluate("window.harmed") is None


def test_no_name_that_a_page_gives_leaves_the_folders(bench, served):
    page = bench()
    for action, given in (
        ("save", {"name": "../evil"}), ("save", {"name": "/tmp/evil"}), ("protocol", {"name": "../../etc/passwd"}),
        ("protocol", {"name": "..\\x"}), ("muscle", {"name": "/etc/passwd"}), ("rig", {"name": "../paper.toml"}),
    ):  # fmt: skip
        answer = page.evaluate("([a, g]) => window.lab.act(a, g)", [action, given])
        assert not answer["ok"] and answer["said"], (action, given)
    for line in ("load /etc/passwd", "load ../x.toml", "save /tmp/x.nc", "record on /tmp/x.mcap"):
        answer = page.evaluate("([l]) => window.lab.act('say', {line: l})", [line])
        assert answer["said"]["refused"], line
    assert not list(served.folder.parent.glob("evil*"))
    found = page.evaluate("window.lab.act('complete', {text: 'load /etc/'})")
    assert found["said"] == []


def test_the_console_speaks_of_what_the_page_shows(bench, until, status):
    page = bench()
    for line, said in (("show", "the dry run passes"), ("status", "idle"), ("pressur 3 bar", "Did you mean"),
                       ("check", "the dry run passes"), ("help", "Emergency stop")):  # fmt: skip
        page.fill("#line", line)
        page.keyboard.press("Enter")
        # the machine by hand may still be compiling, and answers when it is ready
        until(lambda said=said: said in page.locator("#said").inner_text(), 90.0, what=line)


def test_the_link_names_muscle_rig_and_protocol_and_is_followed(bench, visit, until):
    page = bench()
    until(lambda: "muscle=nylon" in page.url and "rig=paper" in page.url)
    page.context.close()
    other = visit("/?muscle=fiberglass&protocol=preconditioning", control=True)
    other.reload()
    other.wait_for_function("window.lab.lab.parts.setup?.muscle === 'fiberglass'")
    other.wait_for_function("window.lab.lab.parts.protocol?.name === 'preconditioning'")
    assert other.evaluate("window.lab.act('muscle', {name: 'nylon'})")["ok"]


@pytest.mark.slow
def test_a_link_waits_for_the_controls_that_a_page_which_vanished_still_holds(bench, visit, until):
    page = bench()
    other = visit("/?muscle=fiberglass")
    other.wait_for_function("window.lab.lab.parts.setup")
    assert other.evaluate("window.lab.lab.parts.setup.muscle") == "nylon" and "muscle=fiberglass" in other.url
    page.context.close()
    other.wait_for_function("window.lab.lab.parts.setup?.muscle === 'fiberglass'")
    assert other.evaluate("window.lab.act('muscle', {name: 'nylon'})")["ok"]


def test_a_stop_is_told_once_and_stays_what_ended_the_run_after_a_reset(bench, until, status):
    page = bench(LONG)
    clicked(page, until, status, 1.0)
    page.keyboard.press("Escape")
    until(lambda: status(page)["shape"] == "tripped" and not status(page).get("running"), 30.0)
    says(page, "#log", "Recorded as long-", "up to the stop")

    def messages_of_the_run():
        log = page.evaluate("window.lab.lab.log.map(m => ({time: m.time, text: m.text, number: m.number}))")
        begun = max(m["number"] for m in log if m["text"].startswith("Started"))
        return [m for m in log if m["number"] >= begun]

    # The state is sent before the messages, and the list of an earlier run may still be on the page.
    until(lambda: any("up to the stop" in m["text"] for m in messages_of_the_run()), 30.0)
    run = messages_of_the_run()
    (stop,) = [m for m in run if "emergency stop at" in m["text"].lower()]
    assert not [m for m in run if "began" in m["text"] and m["number"] > stop["number"]]
    says(page, "#pl", "ended by the emergency stop")
    assert page.evaluate("window.lab.act('reset')")["ok"]
    until(lambda: status(page)["shape"] == "idle")
    says(page, "#pl", "ended by the emergency stop")
    # the read-outs, the lanes and the drawing tell the same sample, with the same places
    shown = page.eval_on_selector_all(
        "#reads .read", "all => all.map(e => [e.dataset.q, e.querySelector('.val').textContent])"
    )
    told = page.evaluate("window.lab.bench.strips.told")
    for (name, words), places in zip(shown, (2, 1, 2), strict=True):
        assert float(words) == pytest.approx(told[name], abs=0.5001 * 10.0**-places), name


def test_no_number_however_large_stops_a_page_from_answering(bench, visit, status, until):
    page = bench(
        SHORT.replace('"0.5 cm"', '"$way"').replace(
            "[[steps]]", '[parameters.way]\nunit = "m"\nvalue = "0.5 cm"\n[[steps]]', 1
        )
    )
    answer = page.evaluate("window.lab.act('value', {name: 'way', words: '1e9'})")
    assert not answer["ok"] and "the longest span of the rig" in answer["said"]
    until(lambda: status(page)["by_hand"] == "ready", 60.0)
    said = page.evaluate("window.lab.act('set', {length: '1e9 cm'})")
    assert not said["ok"] and "5 cm to 40 cm" in said["said"]
    page.evaluate("([t]) => window.lab.act('text', {text: t})", [SHORT.replace("0.5 cm", "1e9 cm")])
    until(lambda: page.evaluate("window.lab.lab.parts.dry?.passed === false"), 30.0)
    says(page, "#dry", "span is 1e+09", "the rig allows up to 40")
    lengths = page.evaluate("window.lab.lab.parts.dry.curves.length")
    assert max(v for v in lengths if v is not None) < 4.0  # ten times what the rig holds [m]
    drawn = page.evaluate("window.lab.bench.strips.total")
    # whatever a server says: one that sends such numbers all the same does not stop the drawing either
    page.evaluate("""() => { const d = structuredClone(window.lab.lab.parts.dry)
        d.curves.length = d.curves.length.map(() => 1e7)
        d.curves.tension = d.curves.tension.map((v, i) => 1e20 * Math.sin(i))
        d.curves.flow = d.curves.flow.map((v, i) => 1e17 + i * 1e-3)
        for (const s of d.lane) s.period = 1e-7
        window.lab.lab.parts.dry = d; window.lab.events.dispatchEvent(new CustomEvent('part', {detail: 'dry'})) }""")
    until(lambda: page.evaluate("window.lab.bench.strips.total") > drawn)
    other = visit("/")
    other.wait_for_function("window.lab.bench && window.lab.bench.strips.total > 0")


def test_the_sentence_of_the_longest_protocols_is_wholly_visible(bench, until):
    page = bench()
    for name in ("lubricant-test", "work-loop"):
        page.evaluate("([n]) => window.lab.act('protocol', {name: n})", [name])
        until(lambda name=name: page.evaluate("window.lab.lab.parts.protocol.name") == name)
        until(lambda: page.evaluate("window.lab.lab.parts.dry?.passed") is not None, 60.0)
        says(page, "#sent", "Vent")
        over = "document.querySelector('#sent').scrollHeight - document.querySelector('#sent').clientHeight"
        assert page.evaluate(over) <= 0
        assert (
            page.evaluate(
                "document.querySelector('#setup').scrollHeight - document.querySelector('#setup').clientHeight"
            )
            <= 0
        )


def test_every_chart_and_control_has_a_name(bench, until):
    page = bench()
    nameless = page.evaluate("""() => [...document.querySelectorAll('button,input,select,textarea,canvas,[role=img]')]
        .filter(e => e.checkVisibility() && !e.closest('[aria-hidden=true]') && !e.closest('.uplot'))
        .filter(e => !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length || e.title))
        .map(e => e.outerHTML.slice(0, 80))""")
    assert nameless == []
    page.click("details.values summary")
    until(lambda: page.locator("#values tbody tr").count() > 20)
    before = page.evaluate("window.lab.bench.strips.cursor")
    page.focus("#strips")
    page.keyboard.press("ArrowRight")
    until(lambda: page.evaluate("window.lab.bench.strips.cursor") != before)


def test_on_a_phone_everything_is_there_and_the_stop_is_under_the_thumb(bench):
    page = bench(width=390, height=844)
    for view, seen in (
        ("loop", "#fl"),
        ("setup", "#sent"),
        ("manual", "#sliders"),
        ("log", "#line"),
        ("live", "#strips"),
    ):
        page.click(f".ptabs [data-view={view}]")
        page.locator(seen).wait_for()  # the loop is drawn with the next frame
    box = page.locator(".ph .estop").bounding_box()
    assert box["height"] >= 44 and box["y"] + box["height"] <= 844
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
