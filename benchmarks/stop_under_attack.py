"""How long an emergency stop takes while clients with and without a token do their worst, on this machine only.

    python benchmarks/stop_under_attack.py [ATTACK ..] [--seconds 8] [--descriptors 1024]

Starts `mckibben serve` with few descriptors, runs one attack after the other against it, bounded in count and time, and
presses stop meanwhile, each time over a new connection as a stranger's script would. Prints median and largest delay, how
many were not answered within 5 s, the server's memory before, at most and after, and what its log grew by.
"""

from __future__ import annotations

import argparse
import asyncio
import base64
import contextlib
import multiprocessing
import os
import re
import resource
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

PRESSES, PATIENCE = 20, 5.0
UPLOAD = 150 * 2**20  # [B]


class Target:
    """Address and cookie of a server."""

    def __init__(self, port: int, token: str) -> None:
        self.port = port
        self.host = f"Host: 127.0.0.1:{port}\r\n"
        self.cookie = f"Cookie: mckibben-{port}={token}\r\n"

    def head(self, method: str, path: str, more: str = "", *, known: bool = True) -> bytes:
        return f"{method} {path} HTTP/1.1\r\n{self.host}{self.cookie if known else ''}{more}\r\n".encode()

    async def open(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        return await asyncio.wait_for(asyncio.open_connection("127.0.0.1", self.port), PATIENCE)

    async def socket(self, path: str = "/live") -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        reader, writer = await self.open()
        key = base64.b64encode(os.urandom(16)).decode()
        upgrade = (
            f"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
        )
        writer.write(self.head("GET", path, upgrade))
        await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), PATIENCE)
        return reader, writer


def frame(text: str, kind: int = 1) -> bytes:
    """A masked frame of a web socket; 1 is text, 2 is binary."""
    data = text.encode()
    size = bytes([128 | len(data)]) if len(data) < 126 else bytes([128 | 126]) + len(data).to_bytes(2, "big")
    return bytes([128 | kind]) + size + bytes(4) + data  # a mask of zeros


async def again(work: Callable[[], Awaitable[None]]) -> None:
    """Repeat what the server cuts, a few times a second."""
    while True:
        with contextlib.suppress(OSError, TimeoutError, asyncio.IncompleteReadError):
            await work()
        await asyncio.sleep(0.2)


async def half_open(target: Target) -> None:
    reader, writer = await target.open()
    writer.write(b"GET / HTTP/1.1\r\nHost")
    await reader.read()


async def trickled_heads(target: Target) -> None:
    _, writer = await target.open()
    writer.write(b"GET / HTTP/1.1\r\n")
    while not writer.is_closing():
        writer.write(b"X-A: b\r\n")
        await asyncio.sleep(1.0)


async def huge_heads(target: Target) -> None:
    _, writer = await target.open()
    writer.write(b"GET / HTTP/1.1\r\nX-A: ")
    for _ in range(100):
        writer.write(b"a" * 100_000)
        await writer.drain()


async def slow_bodies(target: Target) -> None:
    _, writer = await target.open()
    writer.write(target.head("POST", "/measured?name=slow.csv", "Content-Length: 1000000\r\n"))
    while not writer.is_closing():
        writer.write(b"1")
        await asyncio.sleep(1.0)


async def idle_kept_alive(target: Target) -> None:
    reader, writer = await target.open()
    writer.write(target.head("GET", "/favicon.ico"))
    await reader.read()


async def deaf_sockets(target: Target) -> None:
    _, writer = await target.socket()
    writer.write(frame('{"stream":true}'))
    while not writer.is_closing():
        writer.write(frame('{"act":"status"}'))
        await asyncio.sleep(0.005)


async def unknown_sockets(target: Target) -> None:
    reader, _ = await Target(target.port, "x").socket()
    await reader.read(1)
    await asyncio.sleep(60.0)


async def chattering_sockets(target: Target) -> None:
    reader, writer = await target.socket()
    writer.write(frame('{"stream":true}'))
    asyncio.ensure_future(reader.read(-1))  # noqa: RUF006 - ends with the connection
    while not writer.is_closing():
        writer.write(b"".join(frame(t, k) for t, k in (('{"act":"pace","words":{"name":[]}}', 1), ("[" * 99, 1))) * 20)
        await writer.drain()
        await asyncio.sleep(0.01)


async def wrong_frames(target: Target) -> None:
    reader, writer = await target.socket()
    writer.write(frame("x", 2))
    await reader.read()


async def many_pages(target: Target) -> None:
    reader, writer = await target.open()
    writer.write(target.head("GET", "/circuit", "Accept: text/html\r\nConnection: close\r\n"))
    await reader.read()


async def charts(target: Target) -> None:
    reader, writer = await target.open()
    body = b'{"chart":{"name":"x","x":{"label":"x"},"y":{"label":"y"},"lines":[{"x":[0,1],"y":[0,1]}]},"format":"png"}'
    writer.write(target.head("POST", "/figure", f"Connection: close\r\nContent-Length: {len(body)}\r\n") + body)
    await reader.read()


async def uploads(target: Target) -> None:
    reader, writer = await target.open()
    writer.write(target.head("POST", f"/measured?name={os.getpid()}.csv", f"Content-Length: {UPLOAD}\r\n"))
    for _ in range(UPLOAD // 2**20):
        writer.write(b"1,2,3,4\n" * 2**17)
        await writer.drain()
    await reader.read()
    await asyncio.sleep(60.0)


# how many of each at once
ATTACKS: dict[str, tuple[Callable[[Target], Awaitable[None]] | None, int]] = {
    "none": (None, 0),
    "half_open": (half_open, 1100),
    "trickled_heads": (trickled_heads, 1100),
    "huge_heads": (huge_heads, 50),
    "slow_bodies": (slow_bodies, 300),
    "idle_kept_alive": (idle_kept_alive, 1100),
    "unknown_sockets": (unknown_sockets, 1100),
    "deaf_sockets": (deaf_sockets, 60),
    "chattering_sockets": (chattering_sockets, 30),
    "wrong_frames": (wrong_frames, 100),
    "many_pages": (many_pages, 16),
    "charts": (charts, 40),
    "uploads": (uploads, 4),
}


def attack(name: str, target: Target, seconds: float) -> None:
    """Run an attack for a time, in a process of its own."""
    work, count = ATTACKS[name]
    resource.setrlimit(resource.RLIMIT_NOFILE, (4096, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))

    async def run() -> None:
        assert work is not None
        tasks = [asyncio.ensure_future(again(lambda: work(target))) for _ in range(count)]
        await asyncio.sleep(seconds)
        for task in tasks:
            task.cancel()

    os.nice(5)
    with contextlib.suppress(asyncio.CancelledError):
        asyncio.run(run())
    os._exit(0)


def press(target: Target) -> float | None:
    """Seconds until a stop is answered; None if it is not."""
    began = time.monotonic()
    try:
        with socket.create_connection(("127.0.0.1", target.port), PATIENCE) as line:
            line.settimeout(PATIENCE)
            line.sendall(target.head("POST", "/emergency-stop", "Content-Length: 4\r\n") + b"test")
            answer = line.recv(4096)
            while answer and b"vented" not in answer:
                answer = line.recv(4096)
    except OSError:
        return None
    return time.monotonic() - began if answer.endswith(b"vented") else None


def memory(process: int) -> float:
    """Resident memory [MB]."""
    text = Path(f"/proc/{process}/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+)", text)[1]) / 1024.0  # type: ignore[index]


def measure(name: str, target: Target, process: int, log: Path, seconds: float) -> None:
    """Attack, press meanwhile, and print a line."""
    before, size = memory(process), log.stat().st_size
    attacker = multiprocessing.get_context("fork").Process(target=attack, args=(name, target, seconds))
    if ATTACKS[name][0] is not None:
        attacker.start()
        time.sleep(1.5)
    delays, most = [], before
    for _ in range(PRESSES):
        delays.append(press(target))
        most = max(most, memory(process))
        time.sleep(max(0.0, (seconds - 2.0) / PRESSES))
    if attacker.pid is not None:
        attacker.join(seconds + 10.0)
        attacker.kill()
    time.sleep(3.0)
    heard = [1e3 * d for d in delays if d is not None]
    shown = f"{statistics.median(heard):8.1f} {max(heard):8.1f}" if heard else "       -        -"
    grown = (log.stat().st_size - size) / 1e3
    print(
        f"{name:20} {shown} {len(delays) - len(heard):6d} {before:8.0f} {most:8.0f} {memory(process):8.0f} {grown:9.1f}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("attack", nargs="*", default=list(ATTACKS))
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--descriptors", type=int, default=1024)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.txt"
        command = [
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
        few = (options.descriptors, resource.getrlimit(resource.RLIMIT_NOFILE)[1])
        with log.open("w") as stream:
            server = subprocess.Popen(
                command,
                stdout=stream,
                stderr=stream,
                cwd=folder,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, few),
            )
        try:
            while not (found := re.search(r"http://[^ ]*:(\d+)/\?token=(\S+)", log.read_text())):
                time.sleep(0.2)
                assert server.poll() is None, log.read_text()
            target = Target(int(found[1]), found[2])
            time.sleep(8.0)  # the machine becomes ready
            print(f"{'attack':20} median    largest  lost   MB before  at most    after    log kB   (delays in ms)")
            for name in options.attack:
                measure(name, target, server.pid, log, options.seconds)
        finally:
            server.send_signal(signal.SIGINT)
            try:
                print("ended with", server.wait(60.0))
            finally:
                server.kill()
                print(log.read_text()[-1500:] if "Traceback" in log.read_text() else "no traceback in the log")


if __name__ == "__main__":
    main()
