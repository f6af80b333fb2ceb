"""Draw the diagrams of the page "How the project is built" from the source code.

    python docs/architecture.py FOLDER      layers.svg and run.svg

`layers` draws the top-level packages in the order of the import contract in `pyproject.toml`, with arrows for the imports
found in the source code, except those that follow from a chain of others and those of the lowest layers. `run` draws the
path of a run; every module named in it must exist.
"""

from __future__ import annotations

import ast
import sys
import tomllib
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
SOURCES = {"mckibben": ROOT / "src" / "mckibben", "lanewise": ROOT / "packages" / "lanewise" / "src" / "lanewise"}
COMPILER = "lanewise"

# Contents of each package, short enough for its box.
CONTENTS = {
    "cli": "the command line",
    "web": "the web interface",
    "report": "figures and reports",
    "studies": "sizing, comparison, design, tubes",
    "control": "controllers and their scores",
    "batch": "sweeps of many variants",
    "bench": "rigs, sessions, runs",
    "identification": "fits, intervals, validation",
    "simulation": "stepped systems, batches, rollouts",
    "analysis": "loops, cycles, energy, timing",
    "assembly": "muscle + circuit + load = machine",
    "engine": "time integration",
    "accessors": "what rooms above carry out",
    "muscles": "laws, friction, elements",
    "pneumatics": "gas, valves, tubes",
    "experiments": "waveforms, protocols",
    "recordings": "recordings, force maps",
    "formats": "files as tables of channels",
    "components": "interfaces of components",
    "specimens": "data of muscles and valves",
    "schema": "tables of TOML files",
    "quantities": "units and bounds",
    "registry": "kinds by name",
    "documents": "safe file access",
    "verbs": "functions that are commands",
    "slips": "sizes nobody can mean",
    "answers": "what must be said with an answer",
    "isolation": "readers that may be ended",
    "citations": "references",
    "estimation": "parameters from residuals",
    "extras": "optional libraries",
    "nomenclature": "names and symbols",
    "errors": "error messages",
    "_jax": "JAX, loaded on first use",
    "_lazy": "modules loaded on first use",
    "_version": "the version",
    COMPILER: "JAX to LLVM, PTX and C",
}
COLOURS = {  # by the uppermost package of a group of layers
    "cli": "#dbe7f3",
    "studies": "#e6e0f0",
    "bench": "#fbe3d0",
    "assembly": "#dcefdc",
    "components": "#ececec",
}
COLUMNS = {"components": (1, 2), "specimens": (3, 2)}  # first column and number of columns, so that no arrow is hidden
TABLE = "accessors"  # names what packages above carry out
FOUNDATION = "schema"  # this layer and those below are used by most packages; they get no arrows
INK, LINE, PAPER = "#222222", "#8a8a8a", "#ffffff"


class Box(NamedTuple):
    """A box of a diagram: left and upper edge, width and height, in pixels."""

    x: float
    y: float
    width: float
    height: float

    @property
    def centre(self) -> float:
        """Horizontal position of the centre."""
        return self.x + self.width / 2


def layers() -> list[list[str]]:
    """Return the layers of the import contract, the uppermost first."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    (contract,) = [c for c in contracts if c["type"] == "layers" and c["containers"] == ["mckibben"]]
    return [layer.split(" | ") for layer in contract["layers"]]


def imports() -> set[tuple[str, str]]:
    """Return the imports between top-level packages, as pairs of the importing and the imported one."""
    known = {name for layer in layers() for name in layer} | {COMPILER}
    found = set()
    folder = SOURCES["mckibben"]
    for path in folder.rglob("*.py"):
        parts = path.relative_to(folder).with_suffix("").parts
        for target in _imported(path, ("mckibben", *parts[:-1])):
            first, _, rest = target.partition(".")
            imported = rest.split(".")[0] if first == "mckibben" else first
            if parts[0] in known - {TABLE} and imported in known and imported != parts[0]:
                found.add((parts[0], imported))
    return found


def _imported(path: Path, package: tuple[str, ...]) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{base}.{alias.name}" for alias in node.names)


def direct(edges: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """Return the edges that do not follow from a chain of other edges."""
    below: dict[str, set[str]] = {}
    for upper, lower in edges:
        below.setdefault(upper, set()).add(lower)

    def reachable(name: str) -> set[str]:
        seen: set[str] = set()
        left = list(below.get(name, ()))
        while left:
            if (nearest := left.pop()) not in seen:
                seen.add(nearest)
                left += below.get(nearest, ())
        return seen

    return {(a, b) for a, b in edges if not any(b in reachable(c) for c in below[a] - {b})}


def draw_layers() -> str:
    """Return the diagram of the packages as SVG."""
    rows = layers()
    names = {name for row in rows for name in row} | {COMPILER}
    if names != set(CONTENTS):
        raise SystemExit(f"docs/architecture.py: describe {sorted(names ^ set(CONTENTS))} in CONTENTS")
    width, height, step, left, gap = 172.0, 40.0, 66.0, 30.0, 14.0
    most = max(len(row) for row in rows)
    whole = left * 2 + most * width + (most - 1) * gap
    ground = next(number for number, row in enumerate(rows) if FOUNDATION in row)
    boxes, fills, fill = {}, {}, ""
    for number, row in enumerate(rows):
        fill = next((COLOURS[name] for name in row if name in COLOURS), fill)
        top = 14.0 + number * step + (22.0 if number >= ground else 0.0)
        wide = 2 * width + gap if len(row) == 1 else width
        begin = (whole - len(row) * wide - (len(row) - 1) * gap) / 2
        for place, name in enumerate(row):
            boxes[name], fills[name] = Box(begin + place * (wide + gap), top, wide, height), fill
            if name in COLUMNS:
                column, taken = COLUMNS[name]
                x = left + column * (width + gap)
                boxes[name] = Box(x, top, taken * width + (taken - 1) * gap, height)
    boxes[COMPILER], fills[COMPILER] = Box(boxes["engine"].x, boxes["components"].y, width, height), PAPER
    lowest = {name for row in rows[ground:] for name in row}
    top = boxes[FOUNDATION].y - 26.0
    bottom = 14.0 + len(rows) * step + 8.0
    parts = [
        f'<rect x="14" y="{top:g}" width="{whole - 28:g}" height="{bottom - top:g}" rx="8" fill="#f7f7f7" stroke="{LINE}" '
        'stroke-dasharray="2 3"/>',
        f'<text x="26" y="{top + 18:g}" font-size="11" text-anchor="start">used by the packages above</text>',
    ]
    parts += [_arrow(boxes[a], boxes[b]) for a, b in sorted(direct(imports())) if b not in lowest]
    parts += [_box(boxes[n], n, CONTENTS[n], fills[n], dashed=n == COMPILER) for n in boxes]
    return _svg(parts, whole, bottom + 14.0, "Packages of mckibben, and the imports between them")


# Boxes of the run: modules (or a title), text, column and row of the place, columns taken.
RUN: dict[str, tuple[str, str, float, int, float]] = {
    "experiments.read": ("experiments.read", "protocol: steps, parameters", 0, 0, 1),
    "bench.rig_file": ("bench.rig_file", "rig: sensors, valve, motor", 1, 0, 1),
    "specimens": ("specimens", "muscle: laws, friction", 2, 0, 1),
    "bench.prepare": ("bench.prepare", "PreparedRun: plan, segments, and the dry run (experiments.dry_run)", 0, 1, 3),
    "bench.session": (
        "bench.session",
        "Session: owns the machine and its clock; cli, console, web and Bluesky are its clients",
        0,
        2,
        3,
    ),
    "bench.protocol_run": ("bench.protocol_run", "ProtocolRun: plays the segments on a machine", 0, 3, 3),
    "bench.software": ("bench.software", "set-points, control, interlocks", 0, 4, 1),
    "bench.sample_loop": ("bench.sample_loop", "SampleLoop: one sample at a time", 1, 4, 1),
    "bench.recorder": ("bench.recorder", "RunRecorder: samples, live log", 2, 4, 1),
    "bench.hardware.interface": ("bench.hardware.interface", "Hardware: counts of sensors, valve and motor", 0, 5, 2),
    "recordings.recording": ("recordings.recording", "Recording: channels, metadata", 2, 5, 1),
    "bench.hardware.simulated": ("bench.hardware.simulated", "assembly, engine, lanewise", 0, 6, 1),
    "bench.hardware.backends": ("bench.hardware.backends", "real machines by name, of mckibben-hardware", 1, 6, 1),
    "recordings.files": ("recordings.files", "formats: .nc, .csv, .mcap, ..", 2, 6, 1),
}
RUN_ARROWS = (
    ("experiments.read", "bench.prepare"),
    ("bench.rig_file", "bench.prepare"),
    ("specimens", "bench.prepare"),
    ("bench.prepare", "bench.session"),
    ("bench.session", "bench.protocol_run"),
    ("bench.protocol_run", "bench.sample_loop"),
    ("bench.software", "bench.sample_loop"),
    ("bench.sample_loop", "bench.recorder"),
    ("bench.sample_loop", "bench.hardware.interface"),
    ("bench.hardware.interface", "bench.hardware.simulated"),
    ("bench.hardware.interface", "bench.hardware.backends"),
    ("bench.recorder", "recordings.recording"),
    ("recordings.recording", "recordings.files"),
)


def draw_run() -> str:
    """Return the diagram of the path of a run as SVG."""
    width, height, gap, step = 262.0, 44.0, 22.0, 76.0
    boxes = {}
    for name, (_, _, column, row, wide) in RUN.items():
        path = SOURCES["mckibben"].joinpath(*name.split("."))
        if not (path.is_dir() or path.with_suffix(".py").is_file()):
            raise SystemExit(f"docs/architecture.py: the module {name} does not exist")
        boxes[name] = Box(20 + column * (width + gap), 14 + row * step, wide * width + (wide - 1) * gap, height)
    both = {("bench.software", "bench.sample_loop"), ("bench.sample_loop", "bench.hardware.interface")}
    parts = [_arrow(boxes[a], boxes[b], both=(a, b) in both) for a, b in RUN_ARROWS]
    fills = {"experiments": "#dcefdc", "specimens": "#ececec", "recordings": "#dcefdc", "bench": "#fbe3d0"}
    for name, (title, text, *_) in RUN.items():
        parts.append(_box(boxes[name], title, text, fills[name.split(".")[0]]))
    rows = 1 + max(row for *_, row, _ in RUN.values())
    return _svg(
        parts, 40 + 3 * width + 2 * gap, 14 + rows * step - 18, "The path of a run from the protocol to the file"
    )


def _box(box: Box, title: str, text: str, fill: str, *, dashed: bool = False) -> str:
    dash = ' stroke-dasharray="5 3"' if dashed else ""
    return (
        f'<rect x="{box.x:g}" y="{box.y:g}" width="{box.width:g}" height="{box.height:g}" rx="5" fill="{fill}" '
        f'stroke="{LINE}"{dash}/>'
        f'<text x="{box.centre:g}" y="{box.y + 17:g}" font-weight="bold">{escape(title)}</text>'
        f'<text x="{box.centre:g}" y="{box.y + 32:g}" font-size="11">{escape(text)}</text>'
    )


def _arrow(upper: Box, lower: Box, *, both: bool = False) -> str:
    start = ' marker-start="url(#head)"' if both else ""
    if upper.y == lower.y:
        path = f"M{upper.x + upper.width:g} {upper.y + upper.height / 2:g}H{lower.x:g}"
    else:
        x0 = min(max(lower.centre, upper.x + 16), upper.x + upper.width - 16)
        x1 = min(max(x0, lower.x + 16), lower.x + lower.width - 16)
        y0, y1 = upper.y + upper.height, lower.y
        bend = 0.5 * (y1 - y0)
        path = f"M{x0:g} {y0:g}C{x0:g} {y0 + bend:g} {x1:g} {y1 - bend:g} {x1:g} {y1:g}"
    return f'<path d="{path}" fill="none" stroke="{LINE}" stroke-width="1.2" marker-end="url(#head)"{start}/>'


def _svg(parts: list[str], width: float, height: float, title: str) -> str:
    head = (
        '<marker id="head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" '
        f'orient="auto-start-reverse"><path d="M0 0L8 4L0 8z" fill="{LINE}"/></marker>'
    )
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
            f'height="{height:g}" font-family="sans-serif" font-size="13" text-anchor="middle" fill="{INK}">',
            f"<title>{escape(title)}</title><defs>{head}</defs>",
            f'<rect width="{width:g}" height="{height:g}" rx="6" fill="{PAPER}"/>',
            *parts,
            "</svg>\n",
        ]
    )


def save(folder: Path) -> None:
    """Write both diagrams to a folder."""
    (folder / "layers.svg").write_text(draw_layers(), encoding="utf-8")
    (folder / "run.svg").write_text(draw_run(), encoding="utf-8")


if __name__ == "__main__":
    save(Path(sys.argv[1]))
