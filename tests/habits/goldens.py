"""What the program answers, kept before a change and compared after it.

    python tests/habits/goldens.py keep FOLDER [--parts calls,bits]      before
    python tests/habits/goldens.py check FOLDER [--parts calls,bits]     after; exit code 1 where something differs

`PARTS` says what there is. All of it runs in this process, as a user types it, without the optional libraries that the
wheel check is without. What changes from run to run is replaced by the patterns of `VARIES`; digests of bits compare on one
machine only, for another processor may round a last digit otherwise. Pictures of pages are compared with a tolerance and
reported; they fail nothing.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import difflib
import hashlib
import importlib.util
import io
import json
import os
import re
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import h5py
import numpy as np

ROOT = Path(__file__).parents[2]
RUNS = {
    "isometric step on the paper's rig": "run isometric-step --muscle nylon",
    "isometric step on the modern rig": "run isometric-step --muscle nylon --rig modern --seed 3",
    "isotonic triangle": "run isotonic-triangle --muscle nylon --rig modern",
    "quasi-static triangle": "run quasi-static --muscle nylon",
    "sinusoids": "run sinusoids --muscle nylon --seed 7",
    "quick release": "run quick-release --muscle nylon --rig modern",
    "work loop": "run work-loop --muscle nylon --rig modern",
    "work loop of a fitted muscle": "run work-loop --muscle DMSP-20-300 --rig modern --seed 1",
    "isokinetic shortening": "run isokinetic --muscle nylon --rig modern",
    "isobaric map": "run isobaric-map --muscle nylon --rig modern",
    "preconditioning": "run preconditioning --muscle nylon --rig modern",
}
# Pattern -> what stands for it: what no two runs have alike.
VARIES = {
    re.escape(str(ROOT)): "ROOT",
    r"/tmp/golden-\w+|\.\./golden-\w+": "ROOM",
    r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?(Z|[+-]\d\d:?\d\d| UTC)?": "TIME",
    r"\b\d{4}-\d\d-\d\d\b(?!\w)": "DATE",
    r"\b\d{1,2} [A-Z][a-z]{2,8} \d{4}\b": "DATE",
    r"DATE and DATE": "DATE",  # over midnight
    r"/dev/pts/\d+": "TERMINAL",
    r"0x[0-9a-f]{8,}": "ADDRESS",
    r'("(?:processor_minutes|steps_per_s|seconds)": )[-\d.e]+': r"\1SPEED",
    # a study that tells what its models cost in time
    r'("(?:time of a run|cost)": \{)[^{}]*"ratio"[^{}]*\}': r"\1SPEED}",
    r'("?\b(?:mckibben|lanewise|python|jax|jaxlib|numpy|scipy|mujoco)"?[:=]? ?"?)v?\d+\.\d+(\.\w+)*': r"\1VERSION",
    r'("version": ")[^"]*': r"\1VERSION",
    r"\b[0-9a-f]{40}\b": "COMMIT",
    r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}": "UUID",
}
PLAIN = tuple(f".{kind}" for kind in "c cpp csv h html json md py svg toml txt xml yaml".split())  # kept as text
SHARE = 0.002  # of the points of a picture that may differ before it is reported
Kept = Iterator[tuple[str, str | bytes]]  # name of a file, and what it holds


def main() -> int:
    """Keep the goldens, or compare with those that were kept; the exit code is 1 where they differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["keep", "check"])
    parser.add_argument("folder", type=Path, help="of the goldens, outside of version control")
    parser.add_argument("--parts", default=",".join(PARTS), help="some of %(default)s")
    options = parser.parse_args()
    names = options.parts.split(",")
    if unknown := [name for name in names if name not in PARTS]:
        parser.error(f"no part {', '.join(unknown)}")
    folder, differing = options.folder.resolve(), 0
    for name in names:
        began, place, found = time.monotonic(), folder / name, {}
        if options.action == "keep":
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir(parents=True)
        for file, content in PARTS[name]():
            path = place / file
            found[file] = content
            if options.action == "keep":
                path.write_bytes(content if isinstance(content, bytes) else content.encode())
            else:
                differing += told(path, content)
        if options.action == "check":
            for path in sorted(place.glob("*")) if found else ():
                if path.name not in found:
                    print(f"{name}/{path.name}: is gone")
                    differing += 1
        print(f"{name}: {len(found)} files, {time.monotonic() - began:.0f} s", flush=True)
    if options.action == "check":
        print(f"{differing} differences" if differing else "All as before")
    return int(bool(differing))


def told(path: Path, now: str | bytes) -> bool:
    """Print how something differs from what was kept; whether that is a fault."""
    where = f"{path.parent.name}/{path.name}"
    if not path.exists():
        print(f"{where}: is new")
        return True
    before = path.read_bytes()
    if isinstance(now, bytes):
        if (share := changed_points(before, now)) > SHARE:
            path.with_suffix(".now.png").write_bytes(now)
            print(f"{where}: {100.0 * share:.1f} % of the picture changed (reported only)")
        return False
    kept = normal(before.decode())  # once more, for patterns that came later
    if kept == now:
        return False
    lines = difflib.unified_diff(kept.splitlines(), now.splitlines(), "before", "now", lineterm="", n=0)
    shown = [line if len(line) < 300 else shortened(line) for line in lines][2:]
    print(f"{where}: differs", *(f"    {line}" for line in shown[:12]), sep="\n")
    if len(shown) > 12:
        print(f"    .. and {len(shown) - 12} lines more")
    return True


def shortened(line: str) -> str:
    """The two ends of a long line."""
    return f"{line[:200]} .. {line[-80:]}"


def changed_points(before: bytes, now: bytes) -> float:
    """Share of the points of a picture that differ by more than a shade."""
    from PIL import Image

    one, other = (np.asarray(Image.open(io.BytesIO(x)).convert("RGB"), dtype=int) for x in (before, now))
    if one.shape != other.shape:
        return 1.0
    return float((np.abs(one - other).max(axis=2) > 24).mean())


def normal(text: str) -> str:
    """A text without what varies from run to run."""
    for pattern, word in VARIES.items():
        text = re.sub(pattern, word, text)
    return text


def module_at(path: Path) -> ModuleType:
    """A file of Python as a module, with the other files of its folder on the path."""
    sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


# ---- the command line


@contextlib.contextmanager
def room() -> Iterator[Path]:
    """An empty folder to work in."""
    home = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="golden-", ignore_cleanup_errors=True) as name:
        os.chdir(name)
        try:
            yield Path(name)
        finally:
            os.chdir(home)


@contextlib.contextmanager
def without_extras() -> Iterator[None]:
    """As if no extra were installed."""
    from mckibben.extras import LIBRARIES

    with patch.dict(sys.modules, dict.fromkeys(LIBRARIES)):
        yield


def called(words: list[str], piped: str = "") -> tuple[int, str, str]:
    """Exit code and both outputs of a call of the command line."""
    from mckibben.cli import main as command_line

    out, err, given = (io.TextIOWrapper(io.BytesIO(text), encoding="utf-8") for text in (b"", b"", piped.encode()))
    code: Any = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), patch.object(sys, "stdin", given):
        try:
            command_line(words)
        except SystemExit as end:
            code = end.code or 0
        except Exception:
            traceback.print_exc()
            code = -1
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode(errors="replace"))  # type: ignore[attr-defined]
    return code, *texts


def page_of(words: list[str], code: int, out: str, err: str, files: Mapping[str, str]) -> str:
    """What a call did, as a text; JSON with a line for each value."""
    with contextlib.suppress(ValueError):
        out = json.dumps(json.loads(out), indent=1, ensure_ascii=False)
    parts = {"exit code": str(code), "standard output": out, "standard error": err} | {
        f"file {n}": t for n, t in files.items()
    }
    body = "".join(f"---- {name}\n{text.rstrip()}\n" for name, text in parts.items() if text)
    return normal(f"mckibben {' '.join(words)}\n{body}")


def name_of(words: list[str], taken: set[str]) -> str:
    """A name of a file for a call."""
    plain = re.sub(r"[^\w.=-]+", "_", normal(" ".join(words)))[:110]
    name, k = f"{plain}.txt", 2
    while name in taken:
        name, k = f"{plain}.{k}.txt", k + 1
    taken.add(name)
    return name


def calls() -> Kept:
    """Every call of the wheel check, as JSON where the command has it, and refusals of each parameter of each command."""
    check = module_at(ROOT / "tests" / "wheel" / "check.py")
    from mckibben.cli.app import COMMANDS

    taken: set[str] = set()
    every = [(name, call) for name in COMMANDS if name in check.CALLS for call in check.CALLS[name]]
    with without_extras(), room() as place:
        check.furnish(place)
        for jobs in check.in_rounds(every):
            for name, call in jobs:
                words = [*name.split(), *call.words]
                if "--json" in options_of(name) and "--json" not in words:
                    words.append("--json")
                code, out, err = called(words, call.piped)
                files = {path: written(place / path) for path in call.writes}
                yield name_of(words, taken), page_of(words, code, out, err, files)
        for name in COMMANDS:
            if name in check.CALLS:
                for words in slips(name, list(check.CALLS[name][0].words)):
                    yield name_of(words, taken), page_of(words, *called(words), {})


def options_of(name: str) -> dict[str, Any]:
    """Options of a command that take a value, and those that take none, by their first name."""
    from mckibben.cli.app import table_of_commands

    command = table_of_commands()
    for word in name.split():
        command = command.commands[word]
    return {p.opts[0]: p for p in command.params if p.param_type_name == "option"}


def slips(name: str, words: list[str]) -> Iterator[list[str]]:
    """Calls with one slip each: a number far out of range, a name that nothing has, or a file that is not there."""
    from mckibben.cli._values import is_input, kind_of

    for option, param in options_of(name).items():
        if getattr(param, "is_flag", False) or option in WITHOUT_SLIP.get(name, ()) + WITHOUT_SLIP[""]:
            continue
        kind, around = kind_of(param), list(words)
        slip = (
            "1e99"
            if kind.unit or param.metavar == "N"
            else "missing.toml"
            if is_input(param)
            else "nothing=of this name"
        )
        if option in around:
            del around[around.index(option) : around.index(option) + 2]
        yield [*name.split(), *around, option, slip]
    if words and not words[0].startswith("-"):
        yield [*name.split(), "missing.toml", *words[1:]]


# Options that take any word, so that a slip would be computed with.
WITHOUT_SLIP: dict[str, tuple[str, ...]] = {"": ("--out",), "device serve": ("--duration",)}


def written(path: Path) -> str:
    """What a file of a call holds, in a few lines where it is no text."""
    if not path.is_file():
        return "was not written"
    if path.suffix == ".nc":
        return recorded(path)
    if path.suffix in PLAIN:
        return path.read_text(encoding="utf-8")
    return f"{path.stat().st_size > 0 and 'is'} there"  # packed files hold times


def helps() -> Kept:
    """The help of every command and group, at a width of 100."""
    from mckibben.cli.app import COMMANDS

    with patch.dict(os.environ, {"COLUMNS": "100"}):
        for name in ["", *COMMANDS]:
            words = [*name.split(), "--help"]
            yield f"{name.replace(' ', '_') or 'mckibben'}.txt", page_of(words, *called(words), {})


# ---- recordings


def recorded(path: Path) -> str:
    """The attributes of a netCDF file, and a digest of the bytes of each data set."""
    lines: list[str] = []

    def visit(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset):
            values = np.asarray(item[()])
            content = repr(values.tolist()).encode() if values.dtype == object else values.tobytes()
            lines.append(f"{name}: {values.dtype} {values.shape} {hashlib.sha256(content).hexdigest()[:16]}")
        lines.extend(f"{name}.{key} = {attribute(value)}" for key, value in sorted(item.attrs.items()) if key[0] != "_")

    with h5py.File(path) as file:
        visit("/", file)
        file.visititems(visit)
    return "\n".join(lines)


def attribute(value: Any) -> str:
    """An attribute of a file as text, JSON with a line for each value; references to other places are none."""
    if isinstance(value, np.ndarray) and value.dtype == object or isinstance(value, h5py.Reference):
        return "references"
    if isinstance(value, bytes | np.bytes_):
        value = value.decode()
    with contextlib.suppress(ValueError, TypeError):
        if isinstance(value, str):
            return json.dumps(json.loads(value), indent=1, ensure_ascii=False)
    return str(value)


def bits() -> Kept:
    """Bits and metadata of the recordings of `RUNS`."""
    with room() as place:
        for name, command in RUNS.items():
            out = place / "recording.nc"
            out.unlink(missing_ok=True)
            code, _, err = called([*command.split(), "--out", str(out)])
            yield f"{name}.txt", normal(f"{command}\n{recorded(out) if not code else err}")


# ---- figures, sources, files


def gallery() -> Kept:
    """Every figure of the tests' gallery, as SVG."""
    sys.path.insert(0, str(ROOT / "tests"))
    figures = module_at(ROOT / "tests" / "report" / "gallery.py").figures()
    from mckibben.report.figures import style

    for name, draw in figures.items():
        drawn = draw()
        yield f"{re.sub(r'[^a-zA-Z0-9]+', '_', name)}.svg", normal(style.to_svg(getattr(drawn, "figure", drawn)))


def sources() -> Kept:
    """What is exported for each host that needs no other program: files as text, and the description inside an FMU."""
    import zipfile

    from mckibben.simulation.air import Air
    from mckibben_hosts import Part
    from mckibben_hosts.targets import TARGETS, export

    parts = {"one": Part({"muscle": "nylon"}, Air(supply="6 bar"), span=0.14)}
    parts["pair"] = Part({"flexor": "nylon", "extensor": "nylon"}, Air(supply="6 bar"), span=0.14)
    with room() as place:
        for title, part in parts.items():
            for target in TARGETS:
                if target == "mujoco" and importlib.util.find_spec("mujoco") is None:
                    continue
                out = place / f"{title}-{target}{'.fmu' if target.startswith('fmi') else ''}"
                export(part, target, out)
                found: dict[str, bytes] = {}
                if out.is_file():
                    with zipfile.ZipFile(out) as packed:
                        found = {n: packed.read(n) for n in packed.namelist() if not n.startswith("binaries/")}
                else:
                    found = {str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*") if p.is_file()}
                for name, content in sorted(found.items()):
                    with contextlib.suppress(UnicodeDecodeError):
                        yield f"{title}-{target}-{name.replace('/', '-')}", normal(content.decode())


def files() -> Kept:
    """Every shipped specimen, protocol, rig, circuit and sweep, written again, or field by field as it was read."""
    from mckibben.assembly.circuit_file import read_circuit
    from mckibben.bench.rig_file import rig, rig_names
    from mckibben.experiments.read import protocol, protocol_names, stimulation_protocol_names
    from mckibben.specimens import specimen_toml, specimens

    for one in specimens():
        yield f"specimen-{one.id}.toml", specimen_toml(one)
    for name in [*protocol_names(), *stimulation_protocol_names()]:
        yield f"protocol-{name}.toml", protocol(name).toml()
    for name in rig_names():
        yield f"rig-{name}.txt", normal(stated(rig(name)))
    for path in sorted((ROOT / "examples" / "circuits").glob("*.toml")):
        yield f"circuit-{path.stem}.txt", normal(stated(read_circuit(path)))


def stated(value: Any) -> str:
    """A value with its fields, one a line; what has none by its type."""

    def plain(one: Any) -> Any:
        if dataclasses.is_dataclass(one) and not isinstance(one, type):
            fields = {f.name: plain(getattr(one, f.name)) for f in dataclasses.fields(one)}
            return {"kind": type(one).__name__} | fields
        if isinstance(one, Mapping):
            return {str(k): plain(v) for k, v in one.items()}
        if isinstance(one, set | frozenset):
            return sorted(map(str, one))
        if isinstance(one, list | tuple):
            return [plain(v) for v in one]
        if hasattr(one, "tolist"):
            return one.tolist()
        if isinstance(one, bool | int | float | str) or one is None:
            return one
        return type(one).__name__

    return json.dumps(plain(value), indent=1, ensure_ascii=False)


# ---- pages


def pages() -> Kept:
    """Pictures of every page of the screen: light, dark, and on a phone."""
    if (chromium := shutil.which("chromium") or shutil.which("chromium-browser")) is None:
        print("pages: left out, no chromium on this machine")
        return
    if importlib.util.find_spec("playwright") is None or importlib.util.find_spec("starlette") is None:
        print("pages: left out, they need playwright and starlette")
        return
    from playwright.sync_api import sync_playwright

    screens, server = (
        module_at(ROOT / "docs" / "screens.py"),
        module_at(ROOT / "tests" / "browser" / "screen_server.py"),
    )
    with room() as place, sync_playwright() as play:
        folder = place / "recordings"
        folder.mkdir()
        for k, muscle in enumerate(("nylon", "fiberglass")):
            called(["run", "work-loop", "--muscle", muscle, "--out", str(folder / f"work-loop-{k + 1:04d}.nc")])
        served = server.Served(folder)
        browser = play.chromium.launch(executable_path=chromium, args=["--headless", "--no-sandbox", "--disable-gpu"])
        try:
            for name, (path, height, _) in screens.PAGES.items():
                size = {"width": 1440, "height": height}
                page = screens.opened(browser, served.address, path, viewport=size, reduced_motion="reduce")
                page.wait_for_function("window.lab && window.lab.lab.open")
                if name == "paper":
                    page.get_by_text("Run without recordings").click()
                page.wait_for_timeout(3000)
                for way in ("light", "dark", "phone"):
                    page.emulate_media(color_scheme="dark" if way == "dark" else "light")
                    if way == "phone":
                        page.set_viewport_size({"width": 390, "height": 844})
                    server.settled(page)
                    yield f"{name}-{way}.png", page.screenshot(full_page=way == "phone")
                page.context.close()
        finally:
            browser.close()
            served.end()


PARTS: dict[str, Callable[[], Kept]] = {
    "calls": calls,
    "help": helps,
    "bits": bits,
    "gallery": gallery,
    "sources": sources,
    "toml": files,
    "pages": pages,
}

if __name__ == "__main__":
    sys.exit(main())
