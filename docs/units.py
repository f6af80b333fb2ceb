"""Convert the docstrings of this package to Markdown: equations become blocks of text, units in brackets no links."""

from __future__ import annotations

import re
from typing import Any

import griffe

SECTIONS = ("Args:", "Returns:", "Raises:", "Attributes:", "Yields:")


class Units(griffe.Extension):
    """Extension of griffe that converts every collected docstring."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Convert the docstring of one object."""
        if obj.docstring is not None:
            obj.docstring.value = escaped(fenced(obj.docstring.value))


def escaped(text: str) -> str:
    """Escape the second of two bracketed units: ``[Pa] [N]`` would be a link."""
    return re.sub(r"(\[[^\[\]\n]+\]) (\[)", r"\1 \\\2", text)


def fenced(text: str) -> str:
    """Put indented equations in fences, so that a preceding list ends, and shorten the gap before equation numbers."""
    out: list[str] = []
    block: list[str] = []
    lines = [*text.splitlines(), ""]
    for i, line in enumerate(lines):
        begins = line.startswith("    ") and (
            block or (i > 0 and not lines[i - 1].strip() and "".join(out[-2:-1]) not in SECTIONS)
        )
        if begins or (block and not line.strip() and i + 1 < len(lines) and lines[i + 1].startswith("    ")):
            block.append(re.sub(r" {3,}(?=\((?:eqs?\.|`))", "   ", line[4:]))
            continue
        if block:
            while not block[-1].strip():
                block.pop()
            out += ["```text", *block, "```", ""]
            block = []
        out.append(line)
    return "\n".join(out).rstrip()
