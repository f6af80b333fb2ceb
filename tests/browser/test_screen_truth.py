"""What the screen says is so: of a run, of the machine that stands still, of a link, of a change that is taken back."""

import re

import pytest
from screen_server import says, settled
from test_screen_bench import SHORT, bench, clicked  # noqa: F401 (a fixture)

from mckibben.nomenclature import GLOSSARY
from mckibben.recordings import read_recording
from mckibben.studies.sizing import size
from mckibben.web.bench import machine
from mckibben.web.bench.machine import RunController
from mckibben.web.pages.circuit.document import muscle_of, packed, planned
from mckibben.web.pages.fit.results import beyond_best

UNTIL = SHORT.replace('"up"\n', '"up"\nuntil = "pressure >= 1 bar"\nfor = "5 s"\n').replace(
    'name = "short"', 'name = "early"'
)


def ended(page, status, until):
    until(lambda: status(page).get("ended", {}).get("file") and not status(page).get("running"), 60.0)
    return status(page)["ended"]


def by_hand(page):
    """Length of the machine, as its own console tells it [cm]."""
    said = page.evaluate("window.lab.act('say', {line: 'status'}).then(a => a.said.text)")
    words = next(line for line in said.splitlines() if line.startswith("span")).split()
    return float(words[1]) * {"cm": 1.0, "mm": 0.1, "m": 100.0}[words[2]]


def test_while_another_muscle_is_tried_nothing_of_the_former_is_drawn(bench, until):  # noqa: F811
    page = bench()
    until(
        lambda: page.evaluate("window.lab.lab.parts.dry?.passed === true && Boolean(window.lab.bench.loop.laws)"), 60.0
    )
    page.evaluate("""() => { window.wrong = 0; window.looks = 0
        const was = window.lab.lab.parts.setup.muscle; const laws = window.lab.bench.loop.laws
        const look = () => { const { setup, dry } = window.lab.lab.parts; const { loop, strips } = window.lab.bench
            if (dry.pending && setup.muscle !== was) {
                window.looks++; if (loop.dry || loop.laws === laws || strips.source) window.wrong++ }
            requestAnimationFrame(look) }; look() }""")
    page.evaluate("window.lab.act('muscle', { name: 'fiberglass' })")
    until(lambda: page.evaluate("window.looks > 0 && !window.lab.lab.parts.dry.pending"), 60.0)
    assert page.evaluate("window.wrong") == 0


def test_a_run_without_a_sample_shows_none_of_the_run_before(bench, status, until):  # noqa: F811
    page = bench()
    clicked(page, until, status)
    ended(page, status, until)
    page.evaluate("""() => { window.wrong = 0; window.looks = 0
        const look = () => { const s = window.lab.lab.status; const b = window.lab.bench
            if (s.running && s.time === 0) { window.looks++; if (b.mode !== 'dry') window.wrong++ }
            requestAnimationFrame(look) }; look() }""")
    page.evaluate("window.lab.act('start').then(() => window.lab.act('pause'))")  # one after the other
    until(lambda: status(page)["shape"] == "paused")
    until(lambda: page.evaluate("window.looks") > 3)  # a busy machine draws few pictures a second
    assert page.evaluate("window.wrong") == 0
    page.click("#stop")
    until(lambda: not status(page).get("running"), 30.0)


def test_numbers_at_rest_are_those_of_the_machine_from_which_a_set_point_goes_on(bench, status, until):  # noqa: F811
    page = bench()
    clicked(page, until, status)
    ended(page, status, until)
    assert page.evaluate("window.lab.act('value', {name: 'high', words: '1 bar'})")["ok"]
    until(lambda: page.evaluate("window.lab.bench.mode === 'dry' && window.lab.lab.parts.dry?.passed"))
    length = by_hand(page)
    says(page, "#reads [data-q=length]", f"{length:.2f}", "at rest")
    field = page.locator("#sliders .L .field input")
    until(lambda: abs(float(field.input_value()) - length) < 0.006)  # rounding of both to 0.01 cm
    last = page.evaluate("window.lab.bench.buffer.latest('length')")
    assert abs(last - length) > 0.1  # where the run ended, which is somewhere else


def test_a_stop_is_logged_at_the_time_that_its_recording_says(bench, served, status, until):  # noqa: F811
    page = bench(SHORT.replace("cycles = 3", "cycles = 200"), "real")
    clicked(page, until, status, 0.3)
    page.click("#stop")
    name = ended(page, status, until)["file"]
    (event,) = [e for e in read_recording(served.folder / name).meta["events"] if e.get("code") == "stop"]
    says(page, "#log li:first-child", f"Stopped by you at {event['time']:.3f}", f"{event['time']:.3f}")


def test_a_link_brings_the_numbers_that_were_changed(bench, visit, status, until):  # noqa: F811
    page = bench()
    assert page.evaluate("window.lab.act('protocol', {name: 'work-loop'})")["ok"]
    assert page.evaluate("window.lab.act('value', {name: 'cycles', words: '7'})")["ok"]
    until(lambda: "values=" in page.evaluate("location.href"))
    address = page.evaluate("location.href")
    assert page.evaluate("window.lab.act('protocol', {name: 'work-loop'})")["ok"]  # as it ships
    until(lambda: "values=" not in page.evaluate("location.href"))
    page.close()
    other = visit(address.removeprefix(address.split("/?")[0]), control=True)
    form = "window.lab.lab.parts.protocol.form.find(f => f.name === 'cycles').value"
    until(lambda: other.evaluate(form) == "7", 20.0, "the link lost its number")
    assert other.evaluate("window.lab.act('text', {text: window.lab.lab.parts.protocol.text})")["ok"]
    until(lambda: other.evaluate("window.lab.lab.parts.protocol.edits === null"))
    other.click("#copy")
    says(other, "#toasts", "The text of this protocol is not in it")


def test_what_was_changed_on_the_bench_is_taken_back_by_ctrl_z_change_by_change(bench, until):  # noqa: F811
    page = bench()
    value = "window.lab.lab.parts.protocol.form.find(f => f.name === 'high').value"
    for words in ("1 bar", "3 bar"):
        assert page.evaluate(f"window.lab.act('value', {{name: 'high', words: '{words}'}})")["ok"]
    until(lambda: page.evaluate(value) == "3")
    muscle = "window.lab.lab.parts.setup.muscle"
    page.evaluate("window.lab.act('muscle', {name: 'fiberglass'})")
    until(lambda: page.evaluate(muscle) == "fiberglass")
    page.wait_for_timeout(4_000)  # no change is too old: after 3 s it was
    for expected in (("nylon", "3"), ("nylon", "1"), ("nylon", "2")):
        page.keyboard.press("Control+z")
        try:
            until(lambda e=expected: (page.evaluate(muscle), page.evaluate(value)) == e)
        except AssertionError:
            now = page.evaluate(muscle), page.evaluate(value), page.inner_text("#toasts"), page.inner_text("#log")
            raise AssertionError(f"{expected} was expected; there is {now}") from None
    says(page, "#toasts", "undone: Nylon shell")


def test_a_run_whose_steps_may_end_early_is_said_to_take_at_most_its_time(bench, status, until):  # noqa: F811
    page = bench(UNTIL)
    says(page, "#pr", "at most")
    clicked(page, until, status)
    end = ended(page, status, until)
    assert end["time"] < end["duration"] - 0.05
    says(page, "#pr", "recorded and kept")
    until(lambda: page.get_attribute("#prog", "aria-valuenow") == "100")  # it is over, not half done


@pytest.mark.parametrize(("speed", "said"), [(0.5, "0.5 of real time"), (1.0, "real time")])
def test_a_run_that_does_not_keep_its_pace_says_how_fast_it_goes(monkeypatch, speed, said):
    wall, told = [100.0], []
    monkeypatch.setattr(machine.time, "monotonic", lambda: wall[0])
    bench = type("Bench", (), {"pace": "real", "clock": type("Clock", (), {"halted": False})()})()  # noqa: F811
    run = object.__new__(RunController)
    run.bench, run.new_machine, run.time, run._paced, run._speed, run._told_slow = bench, True, 0.0, None, None, False
    run._say = lambda text, kind: told.append(text)
    for _ in range(30):
        run._measure_pace()
        wall[0], run.time = wall[0] + 0.1, run.time + 0.1 * speed
    assert (run.slow or machine.PACE_NAMES["real"]) == said and len(told) == (speed < 1.0)
    bench.clock.halted = True  # a pause is not slow
    run._measure_pace()
    assert run.slow == ""


def test_a_page_that_draws_too_slowly_for_real_time_says_how_fast_its_run_goes(bench, status, until):  # noqa: F811
    page = bench(SHORT.replace("cycles = 3", "cycles = 200"), "real")
    clicked(page, until, status, 0.2)
    # 0.5 s for each picture: a run goes no farther than 0.07 s before what its page has drawn
    page.evaluate(
        """() => { const draw = () => { const end = performance.now() + 500; while (performance.now() < end);
        window.idle = setTimeout(() => requestAnimationFrame(draw)) }; draw() }"""
    )
    says(page, "#state", "of real time")
    said = float(page.inner_text("#state").split("of real time")[0].split()[-1])
    assert 0.0 < said < 0.9  # from which on it is said
    says(page, "#log", "The run goes at", "it is not computed or shown faster")
    page.evaluate("window.lab.act('stop')")
    until(lambda: not status(page).get("running"), 30.0)


def test_a_circuit_names_no_muscle_of_which_it_takes_no_number(visit, until):
    sized = size(force="50 N", stroke="3 cm", valve="MHE2-3-2")
    document = sized.to_circuit()
    plan = planned(document)
    assert "nylon" not in plan.nodes["muscle"].words
    with pytest.raises(Exception, match="have no place on the bench"):
        muscle_of(plan)  # it would be the nylon muscle
    page = visit(f"/circuit?c={packed(document)}")
    says(page, ".seg[aria-label=Input]", "0 to 5")
    settled(page)
    assert "500000" not in page.inner_text("main") and "nylon" not in page.inner_text("main")


def test_the_list_of_laws_and_the_ranking_count_the_same_parameters(visit, until):
    page = visit("/fit?map=DMSP-20-300&laws=thick_wall,martens_boblan,ideal")
    until(lambda: page.locator(".rank tr.pick").count() == 3, 120.0)
    for row in page.locator(".rank tr.pick").all():
        title, free = row.locator(".law-name").inner_text().split("\n")[0], row.locator("td").nth(2).inner_text()
        label = next(one for one in page.locator("label.law").all_inner_texts() if title.startswith(one.split("\n")[0]))
        assert f"{free} parameters" in label
    assert not re.search(r"\+[-\u2212]|\d\.(?!\d)", page.inner_text(".rank"))  # of a number one sign, and no bare point


@pytest.mark.parametrize(
    ("distance", "words"), [(0.0, "0"), (-161.04, "\u2212161.0"), (61.3, "+61.3"), (None, "\u2013")]
)
def test_a_distance_has_one_sign(distance, words):
    assert beyond_best(distance) == words


def test_the_cursor_of_a_recording_names_the_time_under_it(visit, served, bench, status, until):  # noqa: F811
    page = bench()
    clicked(page, until, status)
    name = ended(page, status, until)["file"]
    page = visit(f"/recordings?a={name}&view=channels")
    plot = page.locator(".timed figure .u-over").first
    plot.wait_for()
    box = plot.bounding_box()
    record = read_recording(served.folder / name)
    span = float(record.time[-1] - record.time[0])
    field = page.evaluate("document.querySelector('.timed figure').whole.x")
    for share in (0.13, 0.37, 0.41, 0.77):
        for height in (0.1, 0.5, 0.9):
            page.mouse.move(box["x"] + share * box["width"], box["y"] + height * box["height"])
            tip = page.locator(".timed figure .tip").first.inner_text()
            named = float(tip.split(",")[0].replace("\u2212", "-").split("\u2009")[0])
            at = field[0] + share * (field[1] - field[0])
            # a pixel of the pointer, and half a distance of the points that are drawn
            assert abs(named - at) < span / box["width"] + 1e-3 + 0.5 * span / min(len(record), 4000), (tip, at)
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page.locator(".timed figure .plot").first.focus()
    page.keyboard.press("+")
    page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"])
    low, high = page.evaluate("document.querySelector('.timed figure').zoomed.x")
    assert page.evaluate("window.atCursor") == pytest.approx(
        low + 0.25 * (high - low), abs=2.0 * (high - low) / box["width"]
    )


def test_a_rig_that_lacks_a_part_names_those_that_have_it_and_a_click_takes_one(bench, until):  # noqa: F811
    page = bench()
    assert page.evaluate("window.lab.act('protocol', {name: 'leak-down'})")["ok"]
    page.click("#dry [data-rig=modern]")
    until(lambda: page.evaluate("window.lab.lab.parts.setup.rig") == "modern")
    says(page, "#dry", "Dry run passed")
    for _ in range(2):  # rig and protocol, as they were for the other tests
        page.evaluate("window.lab.act('undo', {bench: true})")
    until(lambda: page.evaluate("window.lab.lab.parts.setup.rig") == "paper")


def test_a_refused_set_point_moves_nothing(bench, status, until):  # noqa: F811
    page = bench()
    until(lambda: status(page)["by_hand"] == "ready")
    epoch = page.evaluate("window.lab.lab.epoch.epoch")
    said = page.evaluate("window.lab.act('set', {pressure: '99 bar'})")
    assert not said["ok"] and "99 bar" in said["said"]
    page.wait_for_timeout(300)
    assert status(page)["shape"] == "idle" and page.evaluate("window.lab.lab.epoch.epoch") == epoch


def test_escape_stops_a_run_only_where_it_is_seen_and_a_run_is_no_flood_of_words(bench, visit, status, until):  # noqa: F811
    page = bench(SHORT.replace("cycles = 3", "cycles = 200"), "simulated")
    page.evaluate(
        """() => { window.heard = 0; new MutationObserver(list => { for (const m of list) {
        for (let e = m.target.nodeType === 1 ? m.target : m.target.parentElement; e; e = e.parentElement) {
            const live = e.getAttribute('aria-live'); const role = e.getAttribute('role')
            if (live === 'off') break
            if (live || ['status', 'alert', 'log'].includes(role)) { window.heard++; break } } } })
        .observe(document.body, {subtree: true, childList: true, characterData: true}) }"""
    )
    clicked(page, until, status, 1.0)
    before = page.evaluate("window.heard")
    until(lambda: status(page)["time"] > 5.0)  # eight cycles, of which each was said twice
    assert page.evaluate("window.heard") - before <= 1
    other = visit("/fit")
    other.keyboard.press("Escape")
    says(other, "#toasts", "Esc stops a run on the page Bench")
    assert status(other)["running"] and status(other)["shape"] == "running"
    page.keyboard.press("Escape")
    until(lambda: status(page)["shape"] == "tripped" and not status(page).get("running"))
    assert page.evaluate("window.lab.act('reset')")["ok"]


MANY = (
    "ideal,gas_spring,thick_wall,linear_threshold,tondu_lopez,martens_boblan,sarosi"  # laws that come one after another
)


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (1024, 768), (768, 1024), (390, 900)])
@pytest.mark.parametrize(
    "path",
    [
        "/",
        f"/fit?map=DMSP-20-300&laws={MANY}",
        "/compare",
        "/energy",
        "/circuit",
        "/size?lines=no",
        "/paper",
        "/recordings",
    ],
)
def test_what_a_page_loads_moves_nothing_that_one_reads_already(visit, path, width, height):
    page = visit(path, width=width, height=height)
    page.evaluate(
        """() => { window.moved = 0; new PerformanceObserver(list => { for (const e of list.getEntries())
        if (!e.hadRecentInput) window.moved += e.value }).observe({type: 'layout-shift', buffered: true}) }"""
    )
    settled(page)
    assert page.evaluate("window.moved") < 0.1  # what browsers call good


def test_a_fit_that_the_bench_cannot_run_names_the_law_that_it_can(visit, until):
    page = visit("/fit?map=DMSP-20-300&laws=sarosi,martens_boblan&law=sarosi", control=True)
    until(lambda: page.locator(".rank tr.pick").count() == 2, 120.0)
    act = "window.lab.act('rig', {name: 'modern'}).then(() => window.lab.act('protocol', {name: 'isobaric-map'}))"
    assert page.evaluate(act)["ok"]
    page.evaluate("window.lab.act('value', {name: 'pressure', words: '1 bar'})")
    page.wait_for_selector(".rank tr.sel[data-law=sarosi]")
    page.get_by_role("button", name="Use on the bench").click()
    says(page, "#toasts", "cannot run the protocol that is on the bench", "The best law that can is Martens & Boblan")


def test_words_of_the_field_are_explained_where_they_stand_in_the_words_of_the_documentation(visit, until):
    assert len(GLOSSARY) >= 50 and all(one.sentence.endswith(".") for one in GLOSSARY.values())
    page = visit("/energy")
    until(lambda: page.evaluate("CSS.highlights.get('glossary')?.size > 3"))
    place = page.evaluate(
        """() => { const one = [...CSS.highlights.get('glossary')].find(r => { const b = r.getBoundingClientRect()
        return b.top > 60 && b.bottom < innerHeight - 60 }); const b = one.getBoundingClientRect()
        return [one.toString(), b.left + b.width / 2, b.top + b.height / 2] }"""
    )
    page.mouse.move(*place[1:])
    word = next(w for w in GLOSSARY if w.lower() == place[0].lower())
    says(page, "#word", GLOSSARY[word].sentence)
    page.keyboard.press("w")
    says(page, "#words", GLOSSARY["creep"].sentence, GLOSSARY["creep"].page)
    assert page.locator("#words dt").count() == len(GLOSSARY)


@pytest.mark.parametrize("width", [1440, 1024, 768])
def test_words_of_the_drawn_machine_do_not_run_into_each_other(visit, width):
    page = visit("/", width=1600)
    page.evaluate(
        """() => { const { fillText, clearRect } = CanvasRenderingContext2D.prototype; window.said = {}
        CanvasRenderingContext2D.prototype.clearRect = function (...a) {
            if (this.canvas.closest('#stage')) window.said = {}  // of one drawing: the machine may move meanwhile
            return clearRect.apply(this, a) }
        CanvasRenderingContext2D.prototype.fillText = function (t, x, y) {
            if (this.canvas.closest('#stage')) { const m = this.measureText(t); window.wide = innerWidth
                window.said[t] = {
                left: x - m.actualBoundingBoxLeft, right: x + m.actualBoundingBoxRight,
                top: y - m.actualBoundingBoxAscent, bottom: y + m.actualBoundingBoxDescent } }
            return fillText.call(this, t, x, y) } }"""
    )
    page.wait_for_function("() => window.lab?.lab.parts.dry?.passed")
    page.set_viewport_size({"width": width, "height": 900})  # what stands is drawn no second time by itself
    drawn = f"window.wide === {width} && Object.keys(window.said).some(t => t.startsWith('the protocol'))"
    page.wait_for_function(f"() => {drawn}")
    over = page.evaluate(
        """() => { const all = Object.entries(window.said).filter(([t]) => t.length > 1); const wrong = []
        all.forEach(([t, a], i) => all.slice(i + 1).forEach(([u, b]) => {
            if (a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom) wrong.push([t, u]) }))
        return wrong }"""
    )
    assert over == []


def test_a_width_that_nobody_stated_is_not_shown_as_one(bench, until):  # noqa: F811
    page = bench()
    draw = """name => import(document.querySelector('script[src$="bench.js"]').src.replace(
        'bench.js', 'muscle.js')).then(m => { const was = CanvasRenderingContext2D.prototype.fillText
        const said = []; CanvasRenderingContext2D.prototype.fillText = t => said.push(t)
        const muscle = {...window.lab.lab.parts.setup.muscles.find(one => one.id === 'nylon')}
        if (!name) muscle.braid = null
        m.drawStage(document.createElement('canvas'), 720, false, {muscle, now: {length: 14, pressure: 0, tension: 0},
            limits: {tension: 100, pressure: 6.9}, range: null})
        CanvasRenderingContext2D.prototype.fillText = was; return said })"""
    assert any(words.startswith("D") and words.endswith("cm") for words in page.evaluate(draw, "nylon"))
    said = page.evaluate(draw, "")
    assert "width not stated" in said and not any(words.startswith("D") for words in said)


def test_the_number_of_a_loop_does_not_lie_on_the_loop_and_its_direction_is_shown(bench, status, until):  # noqa: F811
    page = bench()
    page.evaluate(
        """() => { window.said = []; window.heads = 0; const was = CanvasRenderingContext2D.prototype.fillText
        CanvasRenderingContext2D.prototype.fillText = function (t, x, y) {
            if (/\\u2060J$/.test(t)) window.said.push([x, y])
            return was.call(this, t, x, y) }
        const loop = window.lab.bench.loop; const draw = loop.live_.bind(loop)
        loop.live_ = (ctx, X, Y) => { const fill = ctx.fill.bind(ctx); let n = 0
            ctx.fill = (...a) => { n++; return fill(...a) }
            draw(ctx, X, Y); delete ctx.fill; window.heads = Math.max(window.heads, n) } }"""
    )
    clicked(page, until, status)
    ended(page, status, until)
    until(lambda: page.evaluate("window.said.length"))
    x, y = page.evaluate("window.said.at(-1)")
    over = """([x, y]) => { const { buffer: b, loop } = window.lab.bench; const u = loop.plot; let on = 0
        for (let k = 0; k < b.n; k++) { const X = u.valToPos(b.c.length[k], 'x', true)
            const Y = u.valToPos(b.c.tension[k], 'y', true)
            if (X > x && X < x + 60 * devicePixelRatio && Y < y && Y > y - 20 * devicePixelRatio) on++ }
        return on }"""
    assert page.evaluate(over, [x, y]) == 0
    assert page.evaluate("window.heads") >= 3  # the area of the loop, and two heads
