"""The laboratory's screen: frames per second, shares of a core, growth of memory, and ten watchers, in a real Chromium.

    python benchmarks/screen.py [--seconds 30] [--watchers 10] [--machine synthetic|simulated] [--out FILE.json]

`synthetic` streams seven channels at 1 kHz that cost nothing to make, so that what is measured is the screen's own work;
`simulated` is the machine by hand in real time, whose physics run in the same process. `--seconds 3600` shows what an hour
leaves in memory. Needs chromium and playwright; shares are of one core, read from /proc.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
             "--disable-background-networking", "--disable-component-update", "--disable-sync",
             "--enable-precise-memory-info", "--js-flags=--expose-gc"]  # fmt: skip
TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100
PIECES = 12  # of the time, after each of which memory is looked at
WANTED = {"frames_per_second": (">=", 50.0), "server_share": ("<=", 0.30), "page_growth_MB_per_hour": ("<=", 20.0),
          "server_growth_MB_per_hour": ("<=", 20.0)}  # fmt: skip


def serve(folder: str) -> None:
    """The server with a machine that makes its samples for nothing; in a process of its own."""
    import numpy as np

    from mckibben.web.bench import Bench
    from mckibben.web.server import listen
    from mckibben.web.server import serve as go
    from mckibben.web.workspace import Workspace

    class Synthetic(Bench):
        """Sines at 1 kHz, handed out fifty times a second as a run does."""

        def __init__(self, lab: Any) -> None:
            super().__init__(lab)
            self.begun = time.perf_counter()
            self.stream.begin("run", "synthetic", 1e-3)
            threading.Thread(target=self.make, daemon=True).start()

        def _open(self) -> None:
            """No machine by hand, which takes its time to be made ready."""

        def make(self) -> None:
            while True:
                time.sleep(0.02)
                until = int((time.perf_counter() - self.begun) * 1000.0)
                t = 1e-3 * np.arange(self.stream.count, until)
                if not len(t):
                    continue
                wave = np.sin(2.0 * np.pi * t)
                self.stream.add(
                    {
                        "pressure": 2.5e5 + 2e5 * wave, "tension": 40.0 + 30.0 * wave, "length": 0.14 - 0.01 * wave,
                        "flow": 2e-4 * np.cos(2.0 * np.pi * t), "valve": 0.3 + 0.2 * wave,
                        "set_pressure": 2.5e5 + 2e5 * wave, "set_length": 0.14 - 0.01 * wave,
                    }
                )  # fmt: skip

        def status(self) -> dict[str, Any]:
            at = 1e-3 * self.stream.count
            return super().status() | {
                "shape": "running", "name": "Running", "moving": True, "running": True, "time": at, "duration": 1e9,
                "words": "synthetic",
                "steps": [{"path": "steps.1", "label": "sines", "start": 0.0, "end": None, "period": 1.0}],
            }  # fmt: skip

    go(
        Workspace(Path(folder), Synthetic),
        listen("127.0.0.1", 0),
        "127.0.0.1",
        show=False,
        tell=lambda s: print(s, flush=True),
    )


def used(pid: int) -> float:
    """Time that a process has had of the processor [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def resident(pid: int) -> float:
    """Memory of a process [MB]."""
    (line,) = [x for x in Path(f"/proc/{pid}/status").read_text().splitlines() if x.startswith("VmRSS")]
    return int(line.split()[1]) / 1024.0


def children(pid: int) -> list[int]:
    """All processes below one."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            found += [int(path.parent.name), *children(int(path.parent.name))]
    return found


def share(pids: list[int], seconds: float) -> float:
    """Of one core, over a time."""

    def total() -> float:
        return sum(used(p) for p in pids if Path(f"/proc/{p}").exists())

    before, begun = total(), time.perf_counter()
    time.sleep(seconds)
    return (total() - before) / (time.perf_counter() - begun)


def opened(browser: Any, url: str) -> Any:
    """A page of the bench that gets samples."""
    # playwright waits for text that it evaluates, which the policy of the pages forbids
    page = browser.new_context(viewport={"width": 1440, "height": 900}, bypass_csp=True).new_page()
    page.goto(url)
    page.wait_for_function("window.lab && window.lab.bench && window.lab.lab.open", timeout=60_000)
    return page


def heap(page: Any) -> float:
    """What a page holds after a collection of garbage [MB]."""
    page.evaluate("window.gc && window.gc()")
    return float(page.evaluate("performance.memory.usedJSHeapSize")) / 2**20


def measure(url: str, pid: int, seconds: float, watchers: int, machine: str) -> dict[str, Any]:
    """All numbers."""
    from playwright.sync_api import sync_playwright

    found: dict[str, Any] = {}
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = opened(browser, url)
        if machine == "simulated":
            page.wait_for_function("window.lab.lab.status.by_hand === 'ready'", timeout=120_000)
            page.evaluate("window.lab.act('set', {pressure: '2 bar', length: '13.5 cm'})")
        page.wait_for_function("window.lab.bench.buffer.n > 2000", timeout=60_000)
        before = heap(page), resident(pid)
        frames, samples, begun = (
            page.evaluate(f"window.lab.bench.{x}") for x in ("strips.total", "buffer.end", "buffer.period")
        )
        began, spent = time.perf_counter(), used(pid)
        course = [(0.0, *before)]
        for k in range(PIECES):
            time.sleep(max(0.0, began + seconds * (k + 1) / PIECES - time.perf_counter()))
            course.append((time.perf_counter() - began, heap(page), resident(pid)))
            print(
                f"after {course[-1][0]:.0f} s: page {course[-1][1]:.1f} MB, server {course[-1][2]:.1f} MB",
                file=sys.stderr,
            )
        wall = time.perf_counter() - began
        found["server_share"] = (used(pid) - spent) / wall
        found["frames_per_second"] = (page.evaluate("window.lab.bench.strips.total") - frames) / wall
        found["samples_per_second"] = (page.evaluate("window.lab.bench.buffer.end") - samples) / begun / wall
        # the first piece is left out: buffers fill, and code is compiled
        for k, name in enumerate(("page", "server"), 1):
            grown, over = course[-1][k] - course[1][k], course[-1][0] - course[1][0]
            found[f"{name}_MB"], found[f"{name}_growth_MB_per_hour"] = course[-1][k], grown * 3600.0 / over
        found["course"] = course
        found["page_share"] = share(children(os.getpid()), min(seconds, 10.0)) - 0.0
        found["frame_ms"] = page.evaluate(
            "(() => { const b = window.lab.bench; const t = performance.now(); let n = 0;"
            " while (performance.now() - t < 500) { b.strips.draw(); n++ } return (performance.now() - t) / n })()"
        )
        page.goto("about:blank")
        time.sleep(2.0)
        found["server_share_without_a_page"] = share([pid], min(seconds, 10.0))
        pages = [opened(browser, url) for _ in range(watchers)]
        time.sleep(2.0)
        found["server_share_with_watchers"] = share([pid], min(seconds, 10.0))
        ends = [p.evaluate("window.lab.bench.buffer.end") for p in pages]
        found["watchers"], found["watchers_apart_s"] = watchers, max(ends) - min(ends)
        browser.close()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--watchers", type=int, default=10)
    parser.add_argument("--machine", choices=("synthetic", "simulated"), default="synthetic")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve(given.serve)
        return
    if CHROMIUM is None:
        sys.exit("no chromium on this machine")
    with tempfile.TemporaryDirectory() as folder:
        own = [sys.executable, __file__, "--serve", folder]
        real = [sys.executable, "-m", "mckibben", "serve", "--no-open", "--port", "0", "--folder", folder]
        command = own if given.machine == "synthetic" else real
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert server.stdout is not None
        try:
            url = next(w for line in server.stdout for w in line.split() if w.startswith("http"))
            time.sleep(30.0)  # what is made ready once is no part of it
            found = measure(url, server.pid, given.seconds, given.watchers, given.machine)
        finally:
            server.send_signal(signal.SIGINT)
            try:
                server.wait(60.0)
            except subprocess.TimeoutExpired:
                server.kill()
            server.stdout.close()
    found |= {"machine": given.machine, "seconds": given.seconds, "load": os.getloadavg()[0], "cores": os.cpu_count()}
    for name, value in found.items():
        sign, limit = WANTED.get(name, ("", 0.0))
        met = (
            ""
            if not sign
            else "  met"
            if (value >= limit if sign == ">=" else value <= limit)
            else f"  wanted {sign} {limit:g}"
        )
        if name != "course":
            print(f"{name:34}{value if isinstance(value, str) else f'{value:.4g}'}{met}")
    if given.out:
        given.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
