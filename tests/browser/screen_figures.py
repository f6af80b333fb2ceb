"""Look at every page in four sizes, light and dark, with real content: what axe finds, what moves, what is cut or covered.

    python tests/browser/screen_figures.py FOLDER [--page recordings] [--scheme dark] [--no-pictures]

Two runs are recorded first for Energy and Recordings, and one on the Bench. FOLDER gets a picture of each page and size and
`figures.json`: violations of WCAG 2.1 AA, layout shift while the page loads, pixels by which it is wider than its window,
words that lie over each other or are cut off, at 100 % and at 200 % zoom. Requires playwright, axe-playwright-python and
chromium.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

WIDTHS = {390: 844, 768: 1024, 1024: 768, 1440: 900}
ZOOMED = {720: 450, 512: 384}  # 1440 and 1024 px at 200 %
SHOWN = {
    "bench": "/",
    "fit": "/fit?map=DMSP-20-300&laws=ideal,thick_wall,tondu_lopez,martens_boblan,sarosi&law=martens_boblan",
    "compare": "/compare",
    "energy": "/energy?recording=one.nc",
    "circuit": "/circuit",
    "size": "/size",
    "paper": "/paper?row=static.stiffness_per_pressure",
    "recordings": "/recordings?a=one.nc&b=two.nc",
}
# Words of which a part is not seen: they lie over others, or end in nothing. What is fixed in the window lies over what is
# scrolled below it, and what has an ellipsis or a title says that it is cut.
COVERED = """() => {
    const fixed = e => { for (; e && e !== document.body; e = e.parentElement)
        if (['fixed', 'sticky'].includes(getComputedStyle(e).position)) return true
        return false }
    const clipped = (e, b) => { let { left, right, top, bottom } = b
        for (let p = e; p && p !== document.body; p = p.parentElement) { const s = getComputedStyle(p)
            if (s.overflowX === 'visible' && s.overflowY === 'visible') continue
            const c = p.getBoundingClientRect()
            left = Math.max(left, c.left); right = Math.min(right, c.right); top = Math.max(top, c.top)
            bottom = Math.min(bottom, c.bottom) }
        return right - left > 1 && bottom - top > 1 ? { left, right, top, bottom } : null }
    const all = []; const cut = []
    const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT)
    for (let n = walk.nextNode(); n; n = walk.nextNode()) {
        const e = n.parentElement; const words = n.textContent.trim()
        if (!words || !e.checkVisibility({ opacityProperty: true, visibilityProperty: true })) continue
        if (e.closest('.vh, script, style, option, [hidden], .tip, #toasts, dialog:not([open])') || fixed(e)) continue
        const range = document.createRange(); range.selectNodeContents(n)
        for (const r of range.getClientRects()) { const b = clipped(e, r)
            // the box of a line is higher than its letters
            if (b) all.push({ words, e, left: b.left + 1, right: b.right - 1, top: b.top + 0.22 * r.height,
                bottom: b.bottom - 0.22 * r.height }) }
        const s = getComputedStyle(e)
        if (e.scrollWidth > e.clientWidth + 1 && s.overflowX === 'hidden' && s.textOverflow !== 'ellipsis' && e.clientWidth
            && !e.title) cut.push(words.slice(0, 60)) }
    const over = []
    all.sort((a, b) => a.top - b.top)
    all.forEach((a, i) => { for (let j = i + 1; j < all.length && all[j].top < a.bottom; j++) { const b = all[j]
        if (a.e !== b.e && a.left < b.right && b.left < a.right && b.bottom > a.top)
            over.push(`${a.words.slice(0, 40)} | ${b.words.slice(0, 40)}`) } })
    return { over: [...new Set(over)], cut: [...new Set(cut)] } }"""
MOVED = """() => { window.moved = 0; window.movers = []; new PerformanceObserver(list => { for (const e of list.getEntries())
    if (!e.hadRecentInput) { window.moved += e.value
        if (e.value > 0.01) window.movers.push(...e.sources.map(s => `${e.value.toFixed(3)} ${s.node?.id
            || s.node?.className?.baseVal || s.node?.className || s.node?.nodeName}`)) } })
    .observe({ type: 'layout-shift', buffered: true }) }"""
WIDER = "document.documentElement.scrollWidth - innerWidth"
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]


def violations(page: Any) -> list[str]:
    """What axe finds on a page, a line for each element."""
    from axe_playwright_python.sync_playwright import Axe

    answer = Axe().run(page, options={"runOnly": {"type": "tag", "values": RULES}, "resultTypes": ["violations"]})
    return [
        f"{one['id']}: {node['target']}: {node['failureSummary'].splitlines()[-1].strip()}"
        for one in answer.response["violations"]
        for node in one["nodes"]
    ]


def record_runs(folder: Path) -> None:
    """Record what the pages are to show: two work loops of other pressures."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, pressure in (("one", "4 bar"), ("two", "2.5 bar")):
        words = ["run", "work-loop", "--muscle", "nylon", "--set", "cycles=3", "--set", f"shortening={pressure}"]
        command = [sys.executable, "-m", "mckibben", *words, "--out", str(folder / f"{name}.nc")]
        subprocess.run(command, check=True, capture_output=True)


def run_on_bench(browser: Any, served: Any) -> None:
    """Run the protocol that is on the bench, for its page to show."""
    context = browser.new_context()
    context.add_cookies([served.cookie])
    page = context.new_page()
    page.goto(served.url)
    page.wait_for_function("() => window.lab?.lab.parts.dry?.passed", timeout=120_000)
    page.evaluate("window.lab.act('pace', { name: 'simulated' }).then(() => window.lab.act('start'))")
    page.wait_for_function("() => window.lab.lab.status.ended?.file && !window.lab.lab.status.running", timeout=300_000)
    context.close()


def look(
    browser: Any, served: Any, path: str, width: int, height: int, scheme: str, zoom: float
) -> tuple[Any, dict[str, Any]]:
    """Open a page, and find its figures."""
    from screen_server import settled

    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=scheme, device_scale_factor=zoom
    )
    context.add_cookies([served.cookie])
    page = context.new_page()
    page.set_default_timeout(120_000)
    page.goto(served.url + path)
    page.evaluate(MOVED)
    page.wait_for_function("() => window.lab && window.lab.lab.open")
    if path.startswith("/fit"):
        page.wait_for_function("() => document.querySelectorAll('.rank tr.pick').length === 5")
    if path.startswith("/size"):
        page.wait_for_selector(".size-facts")
    settled(page)
    covered = page.evaluate(COVERED)
    figures = {"shift": page.evaluate("window.moved"), "wider": page.evaluate(WIDER), **covered}
    return page, figures | {"movers": page.evaluate("window.movers")}


def main() -> None:
    from playwright.sync_api import sync_playwright
    from screen_server import Served

    from conftest import ARGUMENTS, CHROMIUM

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--page", action="append", choices=SHOWN, help="all where none is named")
    parser.add_argument("--scheme", action="append", choices=("light", "dark"), help="both where none is named")
    parser.add_argument("--no-pictures", action="store_true")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    table: list[dict[str, Any]] = []
    print(
        f"{'page':11}{'scheme':7}{'width':>6}{'zoom':>6}{'axe':>5}{'shift':>7}{'wider':>6}{'over':>5}{'cut':>5}{'s':>6}"
    )
    with tempfile.TemporaryDirectory() as home, sync_playwright() as play:
        record_runs(Path(home) / "recordings")
        served = Served(Path(home) / "recordings")
        try:
            browser = play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            for name in given.page or SHOWN:
                if name == "bench":
                    run_on_bench(browser, served)
                for scheme in given.scheme or ("light", "dark"):
                    sizes = [(w, h, 1.0) for w, h in WIDTHS.items()] + [(w, h, 2.0) for w, h in ZOOMED.items()]
                    for width, height, zoom in sizes:
                        began = time.monotonic()
                        page, row = look(browser, served, SHOWN[name], width, height, scheme, zoom)
                        row["axe"] = violations(page)
                        if not given.no_pictures:
                            place = given.folder / f"{name}-{scheme}-{width}.png"
                            page.screenshot(path=place, full_page=True)
                        page.context.close()
                        row |= {"page": name, "scheme": scheme, "width": width, "zoom": zoom}
                        row["seconds"] = time.monotonic() - began
                        table.append(row)
                        print(
                            f"{name:11}{scheme:7}{width:6}{zoom:6.0%}{len(row['axe']):5}{row['shift']:7.3f}{row['wider']:6}"
                            f"{len(row['over']):5}{len(row['cut']):5}{row['seconds']:6.1f}",
                            flush=True,
                        )
                        for key in ("axe", "over", "cut", "movers"):
                            for one in row[key]:
                                print(f"    {key}: {one}", flush=True)
        finally:
            served.end()
            (given.folder / "figures.json").write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main()
