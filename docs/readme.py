"""Bring the numbers in the README up to date: the output below its commands, and the ranking of the laws."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from examples import ExampleError, run_command
from generated import fitted_maps

BEGIN, END = "<!-- ranking: python docs/build.py --readme -->\n", "<!-- end of ranking -->\n"
NAMED = 4  # laws with a row of their own; the others share one


def refresh(path: Path) -> None:
    """Write the README anew; only what is made by commands changes."""
    text = path.read_text(encoding="utf-8")
    head, rest = text.split(BEGIN)
    _, tail = rest.split(END)
    text = head + BEGIN + "\n" + ranking() + "\n" + END + tail
    text = re.sub(r"(?ms)^```console\n(.*?)^```", lambda m: f"```console\n{_commands(m[1])}```", text)
    path.write_text(text, encoding="utf-8")


def _commands(block: str) -> str:
    """Each command; its output where some was shown."""
    out = []
    for piece in re.split(r"(?m)^(?=\$ )", block):
        if not piece.strip():
            continue
        command, _, shown = piece.partition("\n")
        out.append(command)
        if shown.strip():
            text, code = run_command(shlex.split(command)[2:])
            if code:
                raise ExampleError(f"README: `{command}` ended with {code}")
            out.append(re.sub(r"\n\n+\Z", "\n", text).rstrip("\n"))
    return "\n".join(out) + "\n"


def ranking() -> str:
    """The largest error of each law on what it was not shown, best on average first."""
    maps = fitted_maps()
    rows: dict[str, list[float]] = {}
    free = {}
    for _, points, fits in maps:
        for f in fits:
            free[f.law] = len(f.parameters)
            rows.setdefault(f.law, []).extend([f.cv_max_error / points.largest, f.holdout.max_error / points.largest])
    order = sorted(rows, key=lambda law: min(rows[law][0::2]))
    lines = ["| law | parameters |" + "".join(f" {s.id}: pressure out | above 4 bar |" for s, _, _ in maps)]
    lines.append("|---|---:|" + "---:|---:|" * len(maps))
    for law in order[:NAMED]:
        lines.append(f"| `{law}` | {free[law]} |" + "".join(f" {_percent(v)} |" for v in rows[law]))
    others = [rows[law] for law in order[NAMED:]]
    counts = [free[law] for law in order[NAMED:]]
    spread = "".join(f" {_range([r[i] for r in others])} |" for i in range(len(others[0])))
    lines.append(f"| the other {len(others)} | {min(counts)}-{max(counts)} |{spread}")
    return "\n".join(lines) + "\n"


def _percent(value: float) -> str:
    return f"{100 * value:.2f} %" if value < 1.0 else "diverges"


def _range(values: list[float]) -> str:
    return (
        f"{100 * min(values):.0f}-{100 * max(values):.0f} %"
        if max(values) < 1.0
        else f"{100 * min(values):.0f} % or more"
    )
