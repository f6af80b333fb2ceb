"""Time from the key Esc on the page Bench to the vented valve of a machine behind a serial line.

    python benchmarks/stop_delay.py [--times 10] [--own-clock]

The machine is a simulated one behind a pseudo-terminal, in a process of its own; the server has the session of it in another
process, and the page is in a real Chromium. The time begins before the browser is asked to press the key and ends when the
device gives count 0 to its valve, both by the clock of the system. By default the device waits for every command, so that a
busy computer trips no interlock; `--own-clock` lets it sample by its own clock, as a real one does. Needs chromium and
playwright.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from mckibben.bench.prepare import prepare
from mckibben.bench.segment import SegmentMachine, timing_of
from mckibben_hardware.serial_line.device import About
from mckibben_hardware.serial_line.microcontroller import in_process

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
FILLED = 1.9  # bar, of 2 bar that are asked for


def machine_that_notes(path: str):
    """Build a machine that writes down when its valve is vented; called in the process of the device."""
    prepared = prepare("work-loop", muscle="nylon", rig="paper")
    machine = SegmentMachine(prepared, 0, next(prepared.segments()), timing_of(prepared)).at_interface()
    advance, before = machine.advance, 0

    def noted(valve: int, motor: int, opened: bool) -> None:
        nonlocal before
        if before > 0 and valve == 0:
            with open(path, "a", encoding="utf-8") as file:
                file.write(f"{time.time_ns()}\n")
        before = valve
        advance(valve, motor, opened)

    machine.advance = noted
    return machine


def vented(path: Path, begun: int) -> float:
    """Wait for the first vent after a time [ns]; return how much later it was [s]."""
    while True:
        times = [int(line) for line in path.read_text().split()] if path.exists() else []
        later = [t for t in times if t >= begun]
        if later:
            return (later[0] - begun) / 1e9
        time.sleep(0.01)


def measured(address: str, path: Path, times: int) -> list[float]:
    """Measure some stops from a page [s]."""
    from playwright.sync_api import sync_playwright

    found = []
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = browser.new_context().new_page()
        page.set_default_timeout(120_000)
        page.goto(address)
        page.wait_for_function("() => window.lab && window.lab.lab.open && window.lab.bench")
        page.evaluate("() => window.lab.act('ask_control')")
        page.wait_for_function("() => window.lab.lab.status.by_hand === 'ready'")
        for _ in range(times):
            assert page.evaluate("() => window.lab.act('set', {pressure: '2 bar'})")["ok"]
            page.wait_for_function(f"() => window.lab.bench.buffer.latest('pressure') > {FILLED}")
            page.focus("#line")
            begun = time.time_ns()
            page.keyboard.press("Escape")
            found.append(vented(path, begun))
            page.wait_for_function("() => window.lab.lab.status.shape === 'tripped'")
            assert page.evaluate("() => window.lab.act('reset')")["ok"]
            page.wait_for_function("() => window.lab.lab.status.shape === 'idle'")
        browser.close()
    return found


def main() -> None:
    """Serve a device, press Esc, and print the delays."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=10, help="number of stops")
    parser.add_argument("--own-clock", action="store_true", help="the device samples by its own clock")
    options = parser.parse_args()
    prepared = prepare("work-loop", muscle="nylon", rig="paper")
    assert prepared.rig.motor_out is not None
    about = About(motor_rest=int(prepared.rig.motor_out.count(0.0)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "vented"
        with in_process(machine_that_notes, str(path), about=about) as hosted:
            words = [
                sys.executable,
                "-m",
                "mckibben",
                "serve",
                "--no-open",
                "--port",
                "0",
                "--folder",
                f"{folder}/recordings",
            ]
            words += ["--on", f"serial:{hosted.port}", *([] if options.own_clock else ["--lock-step"])]
            with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as server:
                assert server.stdout is not None
                try:
                    line = next(line for line in server.stdout if "http://" in line)
                    address = next(word for word in line.split() if word.startswith("http://"))
                    delays = np.array(measured(address, path, options.times)) * 1e3
                finally:
                    server.terminate()
    print(f"Esc to vented valve, {len(delays)} stops: median {np.median(delays):.1f} ms, longest {delays.max():.1f} ms")


if __name__ == "__main__":
    main()
