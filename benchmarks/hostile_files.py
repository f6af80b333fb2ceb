"""What one file can cost: time, memory and delay of the emergency stop while the server and the commands read hostile files.

    python benchmarks/hostile_files.py [--folder FILES] [--only NAME ..] [--commands]

Files are made in a temporary folder; those of FILES are tried beside them. Of each, the server has to end the reading in one
sentence while its emergency stop is asked for ten times a second, and its memory and that of its processes are looked at.
With `--commands`, `mckibben read` is given the file too, and Ctrl-C and SIGTERM after three seconds of reading.
"""

from __future__ import annotations

import argparse
import gzip
import http.cookiejar
import os
import re
import shutil
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

LONGEST = 120.0  # time after which a reading is given up [s]
BETWEEN = 0.1  # time between two stops [s]
MB = 1e6


def sparse_sheet(path: Path) -> None:
    """One cell in the far corner of a sheet: a rectangle of half a terabyte."""
    from openpyxl import Workbook

    book = Workbook()
    sheet = book.active
    sheet["A1"], sheet["A2"], sheet["XFD1048576"] = "time [s]", 1, 1
    book.save(path)


def repeated_sheet(path: Path) -> None:
    """An .ods whose one row is repeated as often as a sheet has rows, of a cell that is repeated as well."""
    cell = '<table:table-cell table:number-columns-repeated="16384" office:value-type="float" office:value="1"/>'
    row = f'<table:table-row table:number-rows-repeated="1048576">{cell}</table:table-row>'
    names = "".join(f' xmlns:{n}="urn:oasis:names:tc:opendocument:xmlns:{n}:1.0"' for n in ("office", "table", "text"))
    text = (
        f"<office:document-content{names}><office:body><office:spreadsheet>"
        f'<table:table table:name="s">{row}</table:table>'
        "</office:spreadsheet></office:body></office:document-content>"
    )
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        packed.writestr("content.xml", text)


def zip_bomb(path: Path) -> None:
    """A sheet of 3 GB of blanks in 3 MB."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        with packed.open("xl/worksheets/sheet1.xml", "w", force_zip64=True) as stream:
            for _ in range(3000):
                stream.write(b" " * 1_000_000)


def rows_bomb(path: Path) -> None:
    """2 GB of rows in 2 MB."""
    with gzip.open(path, "wb") as stream:
        stream.write(b"time [s],pressure [bar]\n")
        for _ in range(200):
            stream.write(b"0,1\n" * 2_500_000)


def endless_line(path: Path) -> None:
    """A line of 2 GB in 2 MB."""
    with gzip.open(path, "wb") as stream:
        for _ in range(2_000):
            stream.write(b"1" * 1_000_000)


def zeros_matlab(path: Path) -> None:
    """A variable of 200 MB in 200 kB."""
    from scipy.io import savemat

    savemat(path, {"time": np.zeros(200_000_000, np.uint8)}, do_compression=True)


def zeros_hdf5(path: Path, name: str = "time") -> None:
    """A chunked data set of 80 GB that was never written."""
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset(name, (10_000_000_000,), "f8", chunks=(1_000_000,), compression="gzip")


def zeros_netcdf(path: Path) -> None:
    """The same as a netCDF file."""
    import h5netcdf

    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"time": 10_000_000_000}
        file.create_variable("time", ("time",), "f8", chunks=(1_000_000,), compression="gzip")


def long_definition(path: Path) -> None:
    """An MCAP whose message definition states a list of 200 million texts."""

    def text(value: str | bytes) -> bytes:
        data = value if isinstance(value, bytes) else value.encode()
        return struct.pack("<I", len(data)) + data

    def record(opcode: int, body: bytes) -> bytes:
        return struct.pack("<BQ", opcode, len(body)) + body

    magic = b"\x89MCAP0\r\n"
    head = record(1, text("ros2") + text("x"))
    schema = record(3, struct.pack("<H", 1) + text("a/msg/B") + text("ros2msg") + text("string[200000000] x\n"))
    channel = record(4, struct.pack("<HH", 1, 1) + text("t") + text("cdr") + text(b""))
    message = record(5, struct.pack("<HIQQ", 1, 0, 0, 0) + b"\0\1\0\0" + bytes(8))
    end = record(15, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0))
    path.write_bytes(magic + head + schema + channel + message + end + magic)


def zstd_chunk(path: Path) -> None:
    """An MCAP with chunks of 250 MB of zeros."""
    import zstandard

    def record(opcode: int, body: bytes) -> bytes:
        return struct.pack("<BQ", opcode, len(body)) + body

    size = 250 << 20
    packed = zstandard.ZstdCompressor(level=3).compress(bytes(size))
    chunk = struct.pack("<QQQII", 0, 0, size, 0, 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
    magic = b"\x89MCAP0\r\n"
    path.write_bytes(magic + record(1, bytes(8)) + 40 * record(6, chunk) + magic)


def constant_parquet(path: Path) -> None:
    """A column of 500 million equal numbers."""
    import polars

    polars.LazyFrame({"time": [0.0]}).select(
        polars.col("time").repeat_by(500_000_000).explode()
    ).collect().write_parquet(path)


def empty_tdms(path: Path) -> None:
    """A TDMS that states 10^12 samples and has none."""

    def text(value: str) -> bytes:
        return struct.pack("<I", len(value)) + value.encode()

    index = struct.pack("<IIIQ", 20, 10, 1, 10**12)
    objects = struct.pack("<I", 1) + text("/'g'/'time'") + index + struct.pack("<I", 0)
    lead = b"TDSm" + struct.pack("<IIQQ", 0b1110, 4713, len(objects), len(objects))
    path.write_bytes(lead + objects)


def deep_brackets(path: Path) -> None:
    """Lines of blanks and open brackets without an end."""
    path.write_text(8 * ("a [" * 40_000 + "\n"))


def many_columns(path: Path) -> None:
    """As many columns as a line may have, with as many names."""
    path.write_text(",".join(f"{i:x}" for i in range(25_000)) + "\n" + 12 * ("1," * 24_999 + "1\n"))


FILES: dict[str, Callable[[Path], None]] = {
    "sparse.xlsx": sparse_sheet, "repeated.ods": repeated_sheet, "blanks.xlsx": zip_bomb, "rows.csv.gz": rows_bomb,
    "line.csv.gz": endless_line, "zeros.mat": zeros_matlab, "zeros.h5": zeros_hdf5, "zeros.nc": zeros_netcdf,
    "definition.mcap": long_definition, "chunks.mcap": zstd_chunk, "constant.parquet": constant_parquet,
    "empty.tdms": empty_tdms, "brackets.txt": deep_brackets, "columns.csv": many_columns,
}  # fmt: skip


def memory(process: int) -> dict[int, float]:
    """Resident memory of a process and all below it [MB], by number."""
    found: dict[int, float] = {}
    parents: dict[int, int] = {}
    for entry in os.listdir("/proc"):
        if entry.isdecimal():
            try:
                status = Path(f"/proc/{entry}/status").read_text()
            except OSError:
                continue
            parents[int(entry)] = int(re.search(r"PPid:\s*(\d+)", status)[1])  # type: ignore[index]
            resident = re.search(r"VmRSS:\s*(\d+)", status)
            found[int(entry)] = int(resident[1]) * 1024 / MB if resident else 0.0

    def below(one: int) -> bool:
        while one in parents:
            if one == process:
                return True
            one = parents[one]
        return False

    return {one: size for one, size in found.items() if below(one)}


class Server:
    """`mckibben serve` in a process of its own."""

    def __init__(self, folder: Path) -> None:
        command = [sys.executable, "-m", "mckibben", "serve", "--port", "0", "--no-open", "--folder", str(folder)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        assert self.process.stdout is not None
        line = next(one for one in self.process.stdout if "http://" in one)
        address = re.search(r"http://\S+", line)[0]  # type: ignore[index]
        self.base = address.partition("/?")[0]
        self.opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar()))
        self.opener.open(address, timeout=60).read()
        cookies = next(h for h in self.opener.handlers if isinstance(h, urllib.request.HTTPCookieProcessor)).cookiejar
        self.cookie = "; ".join(f"{c.name}={c.value}" for c in cookies)

    def post(self, path: str, data: bytes, timeout: float = LONGEST) -> str:
        """Post something; an answer that refuses is one, too."""
        request = urllib.request.Request(self.base + path, data, {"cookie": self.cookie}, method="POST")
        try:
            with urllib.request.urlopen(request, timeout=timeout) as answer:
                return answer.read().decode("utf-8", "replace")
        except urllib.error.HTTPError as error:
            return error.read().decode("utf-8", "replace")

    def close(self) -> float:
        """End it as a system does; return how long that takes [s]."""
        begun = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return float("nan")
        return time.monotonic() - begun


def attack(server: Server, path: Path) -> dict[str, object]:
    """Give a file to the server, and ask it to stop until the file is answered."""
    answer: list[str] = []

    def send() -> None:
        try:
            answer.append(server.post(f"/measured?name={urllib.parse.quote(path.name)}", path.read_bytes()))
        except OSError as error:
            answer.append(f"no answer: {error}")

    sender = threading.Thread(target=send)
    begun = time.monotonic()
    sender.start()
    delays: list[float] = []
    own, others = 0.0, 0.0
    while sender.is_alive() and time.monotonic() - begun < LONGEST:
        asked = time.monotonic()
        try:
            server.post("/emergency-stop", b"trial", 30)
            delays.append(time.monotonic() - asked)
        except OSError:
            delays.append(30.0)
        sizes = memory(server.process.pid)
        own = max(own, sizes.pop(server.process.pid, 0.0))
        others = max(others, sum(sizes.values()))
        time.sleep(BETWEEN)
    taken = time.monotonic() - begun
    return {
        "file": path.name, "size": path.stat().st_size, "seconds": taken, "server": own, "others": others,
        "stops": len(delays), "median": 1e3 * statistics.median(delays), "largest": 1e3 * max(delays),
        "said": (answer or ["no answer"])[0][:150],
    }  # fmt: skip


def command(path: Path, ending: int | None) -> tuple[float, str]:
    """Read a file on the command line, or end that after a second; the time [s] and what was said."""
    begun = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "mckibben", "read", path.name], cwd=path.parent, stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    if ending is not None:
        try:
            process.wait(3.0)
        except subprocess.TimeoutExpired:
            begun = time.monotonic()
            process.send_signal(ending)
    try:
        said = process.communicate(timeout=LONGEST)[1]
    except subprocess.TimeoutExpired:
        process.kill()
        said = "no end"
    return time.monotonic() - begun, said.strip().splitlines()[-1][:150] if said.strip() else ""


def files(folder: Path, more: Path | None, only: list[str]) -> Iterator[Path]:
    """Make the files, and copy others beside them."""
    for name, make in FILES.items():
        if not only or name in only:
            make(folder / name)
            yield folder / name
    for path in sorted(more.iterdir()) if more is not None else ():
        if path.is_file() and (not only or path.name in only):
            yield Path(shutil.copyfile(path, folder / path.name))


def main() -> None:
    """Print a line for each file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--commands", action="store_true")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        server = Server(Path(place) / "recordings")
        print("file               size kB  seconds  server MB  others MB  stops  median ms  largest ms  said")
        for path in files(Path(place), asked.folder, asked.only):
            r = attack(server, path)
            print(
                f"{r['file']:<18} {r['size'] / 1e3:7.0f}  {r['seconds']:7.1f}  {r['server']:9.0f}  {r['others']:9.0f}"  # type: ignore[operator]
                f"  {r['stops']:5d}  {r['median']:9.1f}  {r['largest']:10.1f}  {r['said']}",
                flush=True,
            )
            if server.process.poll() is not None:
                print(f"{'':18} the server has ended with {server.process.returncode}")
                server = Server(Path(place) / "recordings")
            if asked.commands:
                for title, ending in (("read", None), ("Ctrl-C", signal.SIGINT), ("SIGTERM", signal.SIGTERM)):
                    seconds, said = command(path, ending)
                    print(f"{'':18} {title:8} {seconds:6.1f} s  {said}", flush=True)
        print(f"SIGTERM ends the server within {server.close():.1f} s")


if __name__ == "__main__":
    main()
