"""The web interface in a real Chromium: a server in a separate process; its pages load nothing from elsewhere."""

import shutil
import signal
import time
from collections.abc import Iterator

import pytest
from screen_server import Served

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]  # fmt: skip


@pytest.fixture(scope="session")
def chromium():
    """One browser for all tests of a worker."""
    pytest.importorskip("starlette", reason="starlette is not installed: pip install 'mckibben[web]'")
    sync = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine")
    with sync.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory) -> Iterator[Served]:
    """One server for the tests of a file."""
    found = Served(tmp_path_factory.mktemp("served") / "recordings")
    yield found
    assert found.end() in (0, 130, -signal.SIGINT), found.said
    assert "Traceback" not in found.said, found.said


@pytest.fixture
def visit(chromium, served):
    """Opens pages: ``visit("/fit")``, each in a browser of its own; nothing may come from elsewhere or break in it.

    With ``control=True`` the page is in control, which the one of an earlier test may not have let go of.
    """
    contexts, wrong = [], []

    def go(path: str = "/", *, width: int = 1440, height: int = 900, control: bool = False, **options):
        context = chromium.new_context(viewport={"width": width, "height": height}, **options)
        contexts.append(context)
        context.add_cookies([served.cookie])
        page = context.new_page()
        page.set_default_timeout(60_000)  # a bound for a busy machine, no measure of the screen
        waiting = page.wait_for_function
        # as a function: text is no code under the policy of the pages, which holds in tests too
        page.wait_for_function = lambda words, **given: waiting(words if "=>" in words else f"() => ({words})", **given)
        page.on("pageerror", lambda error: wrong.append(f"{path}: {error}"))
        page.on("console", lambda m: wrong.append(f"{path}: {m.text}") if m.type == "error" and not _quiet(m) else None)
        page.on("request", lambda r: wrong.append(f"{path} loads {r.url}") if not _own(r.url, served.url) else None)
        page.goto(served.url + path)
        page.wait_for_function("window.lab && window.lab.lab.open")
        if control:  # that of an earlier test has gone
            page.evaluate("window.lab.act('ask_control')")
            mine = "window.lab.lab.status.holder === window.lab.lab.page"
            page.wait_for_function(f"(window.lab.act('ask_control'), {mine})", polling=100)
        return page

    yield go
    for context in contexts:
        context.close()
    assert not wrong, wrong


def _own(url: str, home: str) -> bool:
    return url.startswith((home, "data:", "blob:"))


def _quiet(message) -> bool:
    """A refused download or a line that a test cut is an answer, no fault of the page."""
    return "status of 4" in message.text or "WebSocket connection" in message.text or "ERR_" in message.text


@pytest.fixture
def status():
    """What a page knows of the machine."""
    return lambda page: page.evaluate("window.lab.lab.status")


@pytest.fixture
def until():
    """Waits for something to come true; tells what it was when it did not."""

    def wait(true, longest: float = 60.0, what: str = ""):
        end = time.monotonic() + longest
        while not (found := true()):
            assert time.monotonic() < end, what or "it did not come true"
            time.sleep(0.02)
        return found

    return wait
