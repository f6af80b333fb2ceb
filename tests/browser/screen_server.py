"""The web interface, served by a separate process, for tests."""

import signal
import subprocess
import sys
import threading
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

BEGINS = 120.0  # a slow machine compiles meanwhile [s]


class Served:
    """A server that runs: its address, its folder, and what it said.

    Args:
        folder: of its recordings.
        *words: options of the command.
        port: 0 for a free one.
    """

    def __init__(self, folder: Path, *words: str, port: int = 0) -> None:
        self.folder, self.said, self._line = folder, "", threading.Event()
        command = [
            sys.executable,
            "-m",
            "mckibben",
            "serve",
            "--no-open",
            "--port",
            str(port),
            "--folder",
            str(folder),
            *words,
        ]
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=folder.parent
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        if not self._line.wait(BEGINS) or "http://" not in self.said:
            self.end()
            raise AssertionError(f"the server did not begin: {self.said}")
        self.address = next(w for w in self.said.split() if w.startswith("http://"))
        parts = urlsplit(self.address)
        self.url, self.port = f"{parts.scheme}://{parts.netloc}", int(parts.port or 0)
        self.token = parse_qs(parts.query)["token"][0]
        # what a browser has that opened the address
        self.cookie = {"name": f"mckibben-{self.port}", "value": self.token, "url": self.url, "sameSite": "Strict"}
        self.headers = {"Cookie": f"mckibben-{self.port}={self.token}"}

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.said += line
            if "http://" in line:
                self._line.set()
        self._line.set()

    def end(self, how: signal.Signals = signal.SIGINT) -> int:
        """As Ctrl-C does, or by force; the exit code."""
        self.process.send_signal(how)
        try:
            return self.process.wait(90.0)
        finally:
            self.process.kill()
            self._reader.join(10.0)
            assert self.process.stdout is not None
            self.process.stdout.close()


def says(page, place: str, *words: str, longest: float = 20.0) -> None:
    """Wait until a place of a page says all of these words: what a page draws comes a moment after what it knows."""
    from playwright.sync_api import expect  # these tests are left out where it is not installed

    for word in words:
        expect(page.locator(place)).to_contain_text(word, timeout=1e3 * longest, use_inner_text=True)


def settled(page) -> None:
    """Wait until a page has drawn what it computes: the same text twice, a second apart."""
    before = None
    for _ in range(60):
        now = page.evaluate("document.body.innerText.length + ':' + document.querySelectorAll('*').length")
        if now == before and not page.evaluate("!!document.querySelector('.loading, [aria-busy=true]')"):
            return
        before = now
        page.wait_for_timeout(1000)
