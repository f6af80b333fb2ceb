"""Docstrings as they are written here, as Markdown: equations are blocks of text, units in brackets are no links."""

from __future__ import annotations

import re
from typing import Any

import griffe

SECTIONS = ("Args:", "Returns:", "Raises:", "Attributes:", "Yields:")


class Units(griffe.Extension):
    """Changes the text of every docstring that is collected."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Called once for each object."""
        if obj.docstring is not None:
            obj.docstring.value = escaped(fenced(obj.docstring.value))


def escaped(text: str) -> str:
    """The second of two bracketed units escaped: ``[Pa] [N]`` would be a link."""
    return re.sub(r"(\[[^\[\]\n]+\]) (\[)", r"\1 \\\2", text)


def fenced(text: str) -> str:
    """Indented equations in fences, so that a list before them ends; far-off equation numbers come near."""
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
