"""What stands on all eight pages: state, emergency stop, keys, theme, links; who is let in, and what is refused."""

import json
import urllib.error
import urllib.request

import pytest
from screen_server import says

PAGES = {"/": "Bench", "/fit": "Fit", "/compare": "Compare", "/energy": "Energy", "/circuit": "Circuit", "/size": "Size",
         "/paper": "The paper", "/recordings": "Recordings"}  # fmt: skip


def ask(served, path, headers=None, data=None):
    request = urllib.request.Request(served.url + path, headers={**served.headers, **(headers or {})}, data=data)
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, answer.read().decode("utf-8", "replace"), dict(answer.headers)
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode("utf-8", "replace"), dict(error.headers)


@pytest.mark.parametrize("path", PAGES)
def test_state_and_emergency_stop_stand_on_every_page_and_nothing_comes_from_elsewhere(visit, path):
    page = visit(path)
    assert page.locator(".tabs [aria-current=page]").inner_text() == PAGES[path]
    page.locator("#state .state").wait_for()
    says(page, ".estop:visible", "Emergency stop")  # and there is but one
    page.wait_for_timeout(300)  # whatever loads late is seen by the fixture


def test_keys_lead_to_the_pages_and_can_be_switched_off(visit):
    page = visit("/fit")
    page.keyboard.press("g")
    page.keyboard.press("r")
    page.wait_for_url("**/recordings")
    page.wait_for_function("window.lab && window.lab.lab.open")
    page.keyboard.press("?")
    box = page.locator("dialog#keys")
    box.wait_for()
    box.locator("input").uncheck()
    page.keyboard.press("Escape")  # nothing moves, so it closes what is open
    box.wait_for(state="hidden")
    page.keyboard.press("g")
    page.keyboard.press("f")
    page.wait_for_timeout(300)
    assert page.url.endswith("/recordings")


def test_the_theme_stands_in_the_link_and_follows_the_system(visit, until):
    page = visit("/paper", color_scheme="dark")
    paper = "getComputedStyle(document.body).backgroundColor"
    dark = page.evaluate(paper)
    page.click("#theme")
    until(lambda: "theme=light" in page.url and page.evaluate(paper) != dark)
    other = visit("/paper?theme=dark", color_scheme="light")
    assert other.evaluate(paper) == dark


def test_projector_mode_stands_in_the_link_and_makes_text_larger(visit, until):
    page = visit("/recordings")
    size = "parseFloat(getComputedStyle(document.body).fontSize)"
    usual = page.evaluate(size)
    page.keyboard.press("j")
    until(lambda: "projector=1" in page.url and page.evaluate(size) > 1.4 * usual)
    page.click("#projector")
    until(lambda: "projector" not in page.url and page.evaluate(size) == usual)
    assert visit("/recordings?projector=1").evaluate(size) > 1.4 * usual


@pytest.mark.parametrize("width", [390, 760, 1024])
def test_a_narrow_screen_shows_the_stop_and_does_not_scroll_sideways(visit, width):
    page = visit("/recordings", width=width, height=844)
    box = page.locator(".estop:visible").first.bounding_box()
    assert box["x"] >= 0 and box["x"] + box["width"] <= width and box["y"] + box["height"] <= 844
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_escape_is_the_emergency_stop_even_in_idle_by_its_button_and_stays_until_reset(visit, status, until):
    page = visit("/energy", control=True)
    page.click(".estop")
    until(lambda: status(page)["shape"] == "tripped")
    says(page, ".estop", "Vented")
    until(lambda: page.locator("#state .state").get_attribute("role") == "alert")
    refused = page.evaluate("window.lab.act('start')")
    assert not refused["ok"] and "reset it first" in refused["said"]
    assert page.evaluate("window.lab.act('reset')")["ok"]
    until(lambda: status(page)["shape"] == "idle")


def test_the_second_page_watches_may_stop_and_may_ask_for_the_controls(visit, status, until):
    first, second = visit("/fit", control=True), visit("/fit")
    says(first, "#who", "1 watching")
    refused = second.evaluate("window.lab.act('start')")
    assert not refused["ok"] and "another page is in control" in refused["said"]
    second.click(".estop")  # but it may stop
    until(lambda: status(first)["shape"] == "tripped")
    assert first.evaluate("window.lab.act('reset')")["ok"]
    second.click("#ask-control")
    first.get_by_role("button", name="Hand over").click()
    says(second, "#who", "You control")
    says(first, "#who", "You watch")


def test_a_lost_line_shows_and_comes_back_by_itself(visit, until):
    page = visit("/compare")
    page.context.set_offline(True)
    page.evaluate("window.lab.drop()")
    says(page, "#state", "No connection")
    says(page, ".estop", "cannot reach the machine")
    page.context.set_offline(False)
    until(lambda: "No connection" not in page.locator("#state").inner_text(), 15.0)


def test_only_pages_of_this_server_may_speak_to_it(served):
    assert ask(served, "/fit")[0] == 200
    assert ask(served, "/fit", {"Host": "evil.example"})[0] == 403
    code, said, _ = ask(served, "/emergency-stop", {"Origin": "http://evil.example"}, b"x")
    assert code == 403 and "origin must be" in said
    assert "default-src 'self'" in ask(served, "/fit")[2]["content-security-policy"]


@pytest.mark.parametrize(
    "name", ["../../etc/passwd", "%2e%2e/%2e%2e/etc/passwd", "..%2f..%2fetc%2fpasswd", "a/b.nc", ".hidden.nc", "x.exe"]
)
def test_a_path_in_a_name_leads_nowhere(served, name):
    code, said, _ = ask(served, f"/files/{name}")
    assert code == 404 and "root:" not in said and "Traceback" not in said


def test_an_upload_that_is_too_large_is_refused_before_it_is_read(served):
    code, said, _ = ask(served, "/fit", {"Content-Length": str(10**12), "Connection": "close"})
    assert code == 413 and "must be at most" in said


def test_words_that_are_no_action_are_refused_in_a_sentence(visit):
    page = visit("/fit", control=True)
    for action, given in (("__class__", {}), ("start", {"x": 1}), ("muscle", {"name": "../nylon"}), ("", {})):
        answer = page.evaluate(f"window.lab.act({json.dumps(action)}, {json.dumps(given)})")
        assert not answer["ok"] and answer["said"], action
