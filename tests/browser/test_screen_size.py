"""The page Size in a real Chromium: the answer of the command, what is refused, and links that hold the question."""

import asyncio
import threading
from urllib.parse import quote

import pytest
from screen_server import says

from loops import completed
from mckibben.errors import InputError, MckibbenError
from mckibben.studies.sizing import size
from mckibben.web.elements import PageDocument
from mckibben.web.pages import size as size_page
from mckibben.web.pages.size import FIELDS, LINKED, ROWS, SizePage, SizeQuestion, answer, from_link
from mckibben.web.widgets import box

ASKED = {"force": "35 N", "stroke": "2.8 cm", "battery": "100 Wh", "muscle": "nylon", "lines": "no"}
LONG = 60_000  # a slow machine compiles meanwhile [ms]


@pytest.fixture(scope="module")
def theirs():
    """What `mckibben.size` answers to the same question: the command prints these tables."""
    return size(**from_link(ASKED).arguments())


def open_page(visit, **changes):
    words = {**ASKED, **changes}
    page = visit("/size?" + "&".join(f"{name}={quote(value)}" for name, value in words.items()))
    page.wait_for_selector(".size-facts", timeout=LONG)
    return page


def test_the_answer_is_that_of_the_command_to_the_last_digit(visit, theirs):
    page = open_page(visit)
    for one in theirs.first(ROWS).tables():
        shown = page.get_by_role("table", name=one.title, exact=True)
        rows = shown.locator("tbody tr")
        assert [row.locator("td").all_inner_texts() for row in rows.all()] == one.cells()
        plain = str.maketrans({"\N{NO-BREAK SPACE}": " ", "·": "*", "²": "^2"})  # units are typeset on a page
        assert [head.translate(plain) for head in shown.locator("thead th").all_inner_texts()] == one.heads
    says(page, ".size-facts", "nylon", f"{theirs.chosen.promised_force:.1f} N", "own battery of 100 W h")


def test_a_question_is_changed_refused_and_stands_in_the_link(visit):
    page = open_page(visit)
    page.fill("#size-valve", "Cv=0.3, red")
    page.press("#size-valve", "Enter")
    says(page, "#size-valve-said", "is allowed only without")
    assert page.get_attribute("#size-valve", "aria-invalid") == "true"
    page.fill("#size-valve", "")
    page.fill("#size-stroke", "2 cm")
    page.press("#size-stroke", "Enter")
    page.wait_for_function("location.search.includes('stroke=2+cm') && !location.search.includes('valve')")
    page.wait_for_function("!document.querySelector('.size-result.old') && document.querySelector('.size-facts')")
    assert page.get_attribute("#size-valve", "aria-invalid") == "false"
    page.reload()
    assert page.input_value("#size-stroke") == "2 cm" and page.input_value("#size-battery") == "100 Wh"


def test_what_is_wrong_is_said_beside_its_field_in_the_words_of_the_page(visit):
    page = open_page(visit)

    def wrong(name, words, said):
        right = page.input_value(f"#size-{name}")
        page.fill(f"#size-{name}", words)
        page.press(f"#size-{name}", "Enter")
        says(page, f"#size-{name}-said", said)
        assert not page.inner_text(f"#size-{name}-said").endswith("?.")
        page.fill(f"#size-{name}", right)
        page.press(f"#size-{name}", "Tab")
        page.wait_for_function(f"!document.querySelector('#size-{name}-said')?.innerText.trim()")

    wrong("working_time", "30 h", "working time must be above 0 s")
    wrong("working_time", "30 h", "was 30 s meant?")
    wrong("pressure", "", "Sizing needs a pressure, such as '5 bar'.")
    wrong("tube_length", "", "Sizing needs a tube length, such as '50 cm'.")
    wrong("load", "5 kg", "must be given without a force")
    wrong("valve", "Cv=0.3", "an unticked 'Valves and tubes, simulated'")
    page.get_by_label("Valves and tubes, simulated").check()
    wrong("valve", "Cv=0.3, switching_time=8", "the unit is missing")


def test_what_is_pressed_does_not_move_before_it_is_let_go(visit):
    """To leave a field removes its message, and what lies below moves up: a click of a usual length must not miss it."""
    page = open_page(visit, lines="no")
    page.fill("#size-valve", "Cv=0.3")
    page.press("#size-valve", "Enter")
    says(page, "#size-valve-said", "an unticked")
    page.focus("#size-valve")
    page.keyboard.press("Control+A")
    page.keyboard.press("Delete")  # a hand's change is told when the field is left, so by the press itself
    tick = page.get_by_label("Valves and tubes, simulated")
    tick.scroll_into_view_if_needed()
    at = tick.bounding_box()
    page.mouse.move(at["x"] + at["width"] / 2.0, at["y"] + at["height"] / 2.0)
    page.mouse.down()
    page.wait_for_timeout(150)  # a press of a hand
    page.mouse.up()
    page.wait_for_function("!document.querySelector('#size-valve-said')?.innerText.trim()")
    assert tick.is_checked() and tick.bounding_box()["y"] < at["y"] - 5.0


def test_the_muscle_goes_to_the_bench_in_one_click(visit):
    page = open_page(visit)
    page.click("text=Take to the bench")
    page.wait_for_url("**/?muscle=nylon*", timeout=LONG)


def test_a_link_is_the_question_and_the_question_is_a_link():
    question = SizeQuestion(force="", load="3 kg", valve="Cv=0.3, switching_time=8 ms", lines="no")
    link = {name: value for name, value in question.link().items() if value is not None}
    assert from_link(link) == question and link["force"] == "none"
    assert question.arguments()["force"] is None and question.arguments()["lines"] is False
    assert from_link({"load": "3 kg"}).arguments()["force"] is None  # nobody gave the usual one


def test_a_question_that_was_changed_is_given_up_and_one_line_tells_of_the_newest(monkeypatch):
    """What nobody waits for any more takes no processor from what somebody does."""
    begun, changed, answered = threading.Event(), threading.Event(), []

    def slow(question, progress):
        progress("braids")
        if question.stroke == "3 cm":
            begun.set()
            assert changed.wait(10.0)
        progress("specimens")
        answered.append(question.stroke)
        raise MckibbenError("there is no answer here")

    monkeypatch.setattr(size_page, "answer", slow)

    async def go():
        document = PageDocument()
        with document.root:
            page = SizePage(None, {}, box("div"), box("div"))
            first = asyncio.ensure_future(page.show())
            assert await asyncio.to_thread(begun.wait, 10.0)
            page._take("stroke", "4 cm")
            second = asyncio.ensure_future(page._find())
            await asyncio.sleep(0)
            assert document.root.html().count('class="loading') == 1
            changed.set()
            await asyncio.gather(first, second)

    completed(go())
    assert answered == ["4 cm"]


def test_a_force_beside_a_mass_is_refused_as_on_the_command_line():
    with pytest.raises(InputError, match="load must be given without a force"):
        answer(SizeQuestion(force="50 N", load="20 kg", lines="no"), lambda words: None)
    assert {one.name for group in FIELDS.values() for one in group} | {"muscle", "law", "lines"} == set(LINKED)


def test_a_caution_stands_beside_the_field_that_it_is_about(visit):
    page = open_page(visit, pressure="12 bar")
    says(page, "#size-pressure-said", "McKibben muscles take at most 10 bar")
    assert page.get_attribute("#size-pressure", "aria-invalid") == "false"  # it is in use all the same
    assert page.locator(".size-answer .note").count() == 0  # said once


def test_a_table_that_is_wider_than_a_phone_is_scrolled_by_the_keyboard(visit):
    words = "&".join(f"{name}={quote(value)}" for name, value in ASKED.items())
    page = visit(f"/size?{words}", width=390, height=844)
    page.wait_for_selector(".size-facts", timeout=LONG)
    wide = page.get_by_role("group").filter(has=page.get_by_role("table")).first
    assert wide.evaluate("e => e.scrollWidth > e.clientWidth")
    wide.focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_function("e => e.scrollLeft > 0", arg=wide.element_handle())
