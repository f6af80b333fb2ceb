"""Who is let in, who is who, and what a page says when the server is another one: on a server and in a real Chromium."""

import json
import signal
import urllib.error
import urllib.request

import pytest
from screen_server import Served, says

from mckibben.web.guard import SOCKETS_EACH

LONG = """schema = 1
name = "long"
title = "Long"
[[steps]]
label = "up"
pressure = { to = "2 bar", in = "0.3 s" }
span = { to = "13 cm", in = "0.3 s" }
[[steps]]
for = "60 s"
"""
# What one says on a line of its own, and what it is answered; told from within a page, which has the cookie.
SPEAK = """([hello, asked]) => new Promise(done => {
    const heard = [], line = new WebSocket(`ws://${location.host}/live`)
    line.onopen = () => { line.send(JSON.stringify(hello)); for (const one of asked) line.send(JSON.stringify(one)) }
    line.onmessage = m => {
        if (typeof m.data !== 'string') return
        heard.push(JSON.parse(m.data))
        if (heard.filter(m => m.type === 'answer').length === asked.length) { line.close(); done(heard) }
    }
})"""


def code_of(url, headers=None, data=None):
    request = urllib.request.Request(url, headers=headers or {}, data=data)
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def test_nothing_is_told_or_vented_without_the_token_of_the_printed_address(chromium, served):
    home = served.url
    served.folder.mkdir(parents=True, exist_ok=True)
    (served.folder / "mine-0001.csv").write_text("1")
    for path in (
        "/",
        "/?token=wrong",
        "/fit",
        "/files/mine-0001.csv",
        "/static/lab/lab.css",
        "/elements/x",
    ):
        assert code_of(home + path) == 401, path
    assert code_of(home + "/emergency-stop", data=b"x") == 401
    assert code_of(home + "/files/mine-0001.csv", served.headers) == 200
    page = chromium.new_context().new_page()
    page.goto(f"{home}/fit")  # from a bookmark
    assert "open the address that mckibben serve printed" in page.inner_text("body")
    page.goto(f"{home}/?token={served.token}")
    page.wait_for_function("() => window.lab && window.lab.lab.open")
    assert "token" not in page.url and "token" not in page.evaluate("document.cookie")
    page.goto(f"{home}/fit")  # the bookmark, now
    page.wait_for_function("() => window.lab && window.lab.lab.open")
    page.context.close()


def test_a_public_name_or_an_old_secret_does_not_make_a_page_the_one_in_control(visit, status):
    sent, heard = [], []
    page = visit("/", control=True)
    page.on("websocket", lambda line: (
        line.on("framesent", lambda data: sent.append(data)), line.on("framereceived", lambda data: heard.append(data))
    ))  # fmt: skip
    page.reload()
    page.wait_for_function("window.lab && window.lab.lab.status?.holder === window.lab.lab.page")
    name = page.evaluate("window.lab.lab.page")
    used = next(json.loads(s)["secret"] for s in sent if isinstance(s, str) and "secret" in s)
    valid = next(json.loads(h)["secret"] for h in heard if isinstance(h, str) and '"hello"' in h)
    other = visit("/fit")
    assert used and valid not in json.dumps(status(other)) and valid not in json.dumps(status(page))
    assert valid not in page.evaluate("JSON.stringify([{...sessionStorage}, {...localStorage}, document.cookie])")
    start = [{"id": 1, "act": "vent", "words": {}}]
    for hello in ({"page": name}, {"secret": name}, {"secret": used}, {"secret": used, "page": name}):
        told = other.evaluate(SPEAK, [hello, start])
        assert told[0]["page"] != name, hello
        answer = next(m for m in told if m["type"] == "answer")
        assert not answer["ok"] and "another page is in control" in answer["said"], hello
    assert status(page)["holder"] == name


def test_a_tab_that_is_duplicated_watches_and_its_original_stays_in_control(visit, status, until):
    page = visit("/", control=True)
    with page.expect_popup() as popup:
        page.evaluate("() => { window.open(location.href) }")  # copies sessionStorage, as Duplicate does
    twin = popup.value
    twin.wait_for_function("() => window.lab && window.lab.lab.open")
    says(twin, "#who", "You watch")
    assert twin.evaluate("window.lab.lab.page") != page.evaluate("window.lab.lab.page")
    refused = twin.evaluate("window.lab.act('vent')")
    assert not refused["ok"] and "another page is in control" in refused["said"]
    mine = page.evaluate("window.lab.lab.page")
    page.reload()  # which keeps it
    page.wait_for_function("window.lab && window.lab.lab.open")
    assert page.evaluate("window.lab.lab.page") == mine
    until(lambda: status(page)["holder"] == mine)


@pytest.mark.slow
def test_a_browser_with_too_many_lines_is_told_so_and_may_still_stop(visit, status, until):
    page = visit("/fit", control=True)
    closed = page.evaluate(
        """async most => {
            const one = () => new Promise(done => {
                const line = new WebSocket(`ws://${location.host}/live`)
                line.onopen = () => { line.send('{}'); setTimeout(() => done([line]), 500) }
                line.onclose = e => done([line, e.code, e.reason])
            })
            window.many = await Promise.all(Array.from({ length: most }, one))
            return window.many.filter(l => l.length > 1).map(l => l.slice(1))
        }""",
        SOCKETS_EACH,
    )
    assert 1 <= len(closed) <= 4 and closed[0][0] == 4429 and "close pages that are not needed" in closed[0][1]
    assert page.evaluate("fetch('/emergency-stop', { method: 'POST', body: 'full' }).then(a => a.text())") == "vented"
    page.evaluate("() => { for (const [line] of window.many) line.close() }")
    until(lambda: status(page)["shape"] == "tripped")
    assert page.evaluate("window.lab.act('reset')")["ok"]


@pytest.mark.parametrize("path", ["/", "/fit", "/compare", "/energy", "/circuit", "/paper", "/recordings"])
def test_no_page_allows_that_text_becomes_code(visit, served, path):
    """The pages themselves work under this policy in all tests of the screen, where a violation is a failure."""
    request = urllib.request.Request(served.url + path, headers={**served.headers, "Accept": "text/html"})
    with urllib.request.urlopen(request, timeout=30) as answer:
        policy, page = answer.headers["content-security-policy"], answer.read().decode()
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert "unsafe" not in rules["script-src"] and "*" not in policy and rules["frame-ancestors"] == "'none'"
    nonce = rules["script-src"].split("'nonce-")[1].split("'")[0]
    assert page.count("<script") == page.count(f'<script nonce="{nonce}"') > 0
    with urllib.request.urlopen(request, timeout=30) as answer:
        assert nonce not in answer.headers["content-security-policy"]  # every answer has its own


def test_an_injected_script_does_not_run(chromium, served):
    context = chromium.new_context()
    page = context.new_page()
    page.goto(served.address)
    tried = """() => { const s = document.createElement('script'); s.textContent = 'window.harmed = 1'
        document.body.append(s); setTimeout('window.harmed = 2')
        document.body.insertAdjacentHTML('beforeend', '<img src=data:, onerror="window.harmed = 3">') }"""
    page.evaluate(tried)
    page.wait_for_timeout(300)
    assert page.evaluate("window.harmed") is None
    context.close()


@pytest.mark.parametrize("how", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_after_a_restart_a_page_drops_the_samples_of_the_dead_server_and_says_what_is_lost(
    how, chromium, tmp_path, until
):
    first = Served(tmp_path / "recordings")
    context = chromium.new_context()
    page = context.new_page()
    page.set_default_timeout(30_000)
    page.goto(first.address)
    page.wait_for_function("() => window.lab && window.lab.lab.open")
    assert page.evaluate("([t]) => window.lab.act('text', {text: t})", [LONG])["ok"]
    page.evaluate("window.lab.act('pace', {name: 'real'})")
    until(lambda: page.evaluate("window.lab.lab.parts.dry?.passed === true"), 60.0)
    page.click("#start")
    until(lambda: page.evaluate("window.lab.bench.buffer.n") > 200, 60.0)
    before = page.evaluate("[window.lab.lab.server, window.lab.lab.log.length]")
    first.end(how)
    says(page, "#state", "No connection")
    second = Served(tmp_path / "recordings", port=first.port)
    try:
        says(page, "#refusal", "open the address that mckibben serve printed")  # it has another token
        assert page.evaluate("window.lab.bench.buffer.n") > 200  # grey meanwhile: nobody knows better
        context.new_page().goto(second.address)  # as the new server opens it in the same browser
        says(page, "#news", "The server was restarted. The run that was going on (Long, at ")
        if how == signal.SIGINT:
            says(page, "#news", "What was recorded until then is kept as long-0001.nc.")
        else:
            says(page, "#news", "is lost, and no recording of it was saved.")
        assert page.evaluate("window.lab.lab.server") != before[0]
        assert page.locator("#refusal").count() == 0 and "long" not in page.inner_text("#log")
        assert page.evaluate("window.lab.bench.buffer.n") == 0
        page.bring_to_front()  # what is shown follows with the next frame, and a page in the background draws none
        page.wait_for_function("() => window.lab.bench.mode === 'dry'")
        page.get_by_role("button", name="Close", exact=True).click()
        page.reload()
        page.wait_for_function("() => window.lab && window.lab.lab.open")
        assert page.locator("#news").count() == 0
    finally:
        context.close()
        second.end()
