"""Take the screenshots of the web interface for the documentation, into docs/assets/screen/.

    python docs/screens.py [PAGE ..]

Starts a server of its own, performs a run on the bench, opens every page with the light and the dark theme in Chromium, and
stops the server. Requires playwright, and chromium on the path.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

TO = Path(__file__).resolve().parent / "assets" / "screen"
# Name of a page, its address, its height, and its computing time before the first screenshot [s].
PAGES = {
    "bench": ("/?muscle=nylon&protocol=work-loop", 900, 0),
    "fit": ("/fit?map=DMSP-20-300", 900, 25),
    "compare": ("/compare", 1100, 30),
    "energy": ("/energy", 1240, 15),
    "circuit": ("/circuit", 1120, 30),
    "size": ("/size?force=35+N&stroke=2.8+cm&muscle=nylon&battery=100+Wh", 1000, 90),
    "paper": ("/paper", 900, 120),
    "recordings": ("/recordings?a=work-loop-0001.nc&b=work-loop-0002.nc", 900, 5),
}
SETTLES = 8_000  # time until charts are drawn on a slow machine [ms]


def main(names: list[str]) -> None:
    """Take screenshots of all pages, or of the named ones."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        raise SystemExit("docs: chromium was not found on the path")
    TO.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "mckibben", "serve", "--no-open", "--port", "0", "--folder", folder]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=dict(os.environ))
        assert server.stdout is not None
        try:
            line = next(x for x in server.stdout if "http://" in x)
            address = next(w for w in line.split() if w.startswith("http://"))
            with sync_playwright() as play:
                browser = play.chromium.launch(
                    executable_path=chromium, args=["--headless", "--no-sandbox", "--disable-gpu"]
                )
                recorded(browser, address)
                for name in names or PAGES:
                    for scheme in ("light", "dark"):
                        picture(browser, address, name, scheme)
                browser.close()
        finally:
            server.send_signal(signal.SIGINT)
            server.wait(60)


def opened(browser: Any, address: str, path: str, **options: Any) -> Any:
    """Open a page in a browser context of its own, with the token of the printed address."""
    home, _, token = address.partition("/?token=")
    # playwright evaluates text while waiting, which the content security policy of the pages forbids
    page = browser.new_context(bypass_csp=True, **options).new_page()
    page.set_default_timeout(180_000)
    page.goto(f"{home}{path}{'&' if '?' in path else '?'}token={token}")
    return page


def recorded(browser: Any, address: str) -> None:
    """Record a work loop with two muscles, so that there are recordings to show."""
    for muscle in ("nylon", "fiberglass"):
        page = opened(browser, address, f"/?muscle={muscle}&protocol=work-loop")
        page.wait_for_function("window.lab && window.lab.lab.open")
        page.evaluate("window.lab.act('ask_control')")
        page.evaluate("window.lab.act('pace', {name: 'simulated'})")
        page.wait_for_timeout(SETTLES)
        page.wait_for_function("window.lab.lab.parts.dry?.passed && window.lab.lab.status.shape === 'idle'")
        page.wait_for_function(f"window.lab.lab.parts.setup.muscle === '{muscle}'")
        page.click("#start")
        page.wait_for_function("window.lab.lab.status.running")
        page.wait_for_function("!window.lab.lab.status.running && window.lab.lab.status.ended?.file")
        page.evaluate("window.lab.act('pace', {name: 'real'})")
        page.context.close()


def picture(browser: Any, address: str, name: str, scheme: str) -> None:
    """Take the screenshot of one page with one theme; the bench during a run."""
    path, height, computes = PAGES[name]
    page = opened(browser, address, path, viewport={"width": 1440, "height": height}, color_scheme=scheme)
    page.wait_for_function("window.lab && window.lab.lab.open")
    if scheme == "light":
        if name == "paper":
            page.get_by_text("Run without recordings").click()
        page.wait_for_timeout(1_000 * computes)
    if name == "bench":
        page.evaluate("window.lab.act('ask_control')")
        page.wait_for_function("window.lab.lab.status.shape === 'idle' && window.lab.lab.parts.dry?.passed")
        page.wait_for_timeout(SETTLES)
        page.evaluate("window.lab.act('pace', {name: 'real'})")
        page.click("#start")
        page.wait_for_function("window.lab.lab.status.running && window.lab.lab.status.time > 0")
    page.wait_for_timeout(SETTLES)
    page.screenshot(path=TO / f"{name}-{scheme}.png")
    print(f"  {name}, {scheme}", flush=True)
    if name == "bench":
        page.evaluate("window.lab.act('stop')")
        page.wait_for_function("window.lab.lab.status.shape === 'idle'")
    page.context.close()


if __name__ == "__main__":
    main(sys.argv[1:])
