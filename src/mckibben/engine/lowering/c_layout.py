"""What the structs of a program in C are called, and what stands in them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from ...errors import InputError

if TYPE_CHECKING:
    from .program import Leaf, Program

KEYWORDS = frozenset(
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while "
    "class delete explicit export false friend mutable namespace new operator private protected public template this throw "
    "true try typename using virtual bool and or not xor".split()  # of C++ too, which may include the header
)
OWN = re.compile(r"[a-z]\d+(_\d+)?|scratch")  # what the body calls its values
FIRST = re.compile(r"\[(\d+)\]")


class Member(NamedTuple):
    """A member of a struct.

    Attributes:
        name: in C.
        path: dotted.
        kind: of its numbers.
        shape: () for a number, else the member is an array of all elements in C order.
        argument: its place among the program's arguments, None for a result.
        result: its place among the program's results, None for an argument that is only read.
    """

    name: str
    path: str
    kind: str
    shape: tuple[int, ...]
    argument: int | None
    result: int | None


class Group(NamedTuple):
    """A struct, and the parameter that points to it."""

    name: str
    members: list[Member]

    @property
    def given(self) -> bool:
        """Whether the function reads it."""
        return any(m.argument is not None for m in self.members)

    @property
    def replaced(self) -> bool:
        """Whether the function reads it and writes it anew."""
        return self.given and any(m.result is not None for m in self.members)

    def said(self) -> str:
        """What becomes of it, in words."""
        return f"{self.name}: " + ("read, then replaced" if self.replaced else "read" if self.given else "written")


def grouped(program: Program, name: str, arguments: Sequence[str] | None, results: Sequence[str] | None) -> list[Group]:
    """The structs of a program; an argument or result without numbers has none.

    Raises:
        InputError: see `emit_c.c_sources`.
    """
    _identifier("name", name)
    before = _parts("arguments", program.arguments, arguments, "argument")
    after = _parts("results", program.results, results, "result")
    groups = []
    for called, places in before.items():
        members = _members(program.arguments, places, argument=True)
        if called in after:
            ends = _members(program.results, after[called], argument=False)
            _same(called, members, ends)
            members = [m._replace(result=e.result) for m, e in zip(members, ends, strict=True)]
        groups.append(Group(called, members))
    groups += [Group(c, _members(program.results, p, argument=False)) for c, p in after.items() if c not in before]
    return [g for g in groups if g.members]


def _same(called: str, before: list[Member], after: list[Member]) -> None:
    """Refuse a result that cannot stand where the argument stood."""
    places = [{m.path: (m.kind, m.shape) for m in members} for members in (before, after)]
    for path in (*places[0], *places[1]):
        if places[0].get(path) != places[1].get(path):
            raise InputError(
                "results", called, f"{path or 'its value'} is not the same in the argument that it replaces"
            )


def _identifier(field: str, name: str) -> None:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or name in KEYWORDS or OWN.fullmatch(name):
        raise InputError(
            field, name, "allowed is a name in C: letters, digits and _, no keyword, and no letter with a number"
        )


def _parts(field: str, leaves: Sequence[Leaf], names: Sequence[str] | None, default: str) -> dict[str, list[int]]:
    """Places of the leaves by the name of the argument or result that they belong to."""
    first = [FIRST.match(leaf.name) for leaf in leaves]
    split = all(m is not None or leaf.kind is None for m, leaf in zip(first, leaves, strict=True))
    numbers = [int(m[1]) if split and m else 0 for m in first]
    count = 1 + max(numbers, default=-1)
    if names is None:
        names = [f"{default}{k}" for k in range(count)] if split else [default]
    if len(names) < count:  # more is allowed: the last ones may carry nothing
        raise InputError(field, ", ".join(names) or "none", f"allowed are {count} names")
    for name in names:
        _identifier(field, name)
    if len(set(names)) < len(names):
        raise InputError(field, ", ".join(names), "allowed are names that differ")
    found: dict[str, list[int]] = {name: [] for name in names}
    for place, number in enumerate(numbers):
        if leaves[place].kind is not None:
            found[names[number]].append(place)
    return found


def _members(leaves: Sequence[Leaf], places: Sequence[int], *, argument: bool) -> list[Member]:
    found: list[Member] = []
    taken: set[str] = set()
    for place in places:
        leaf = leaves[place]
        path = dotted(leaf.name)
        plain = re.sub(r"_+", "_", re.sub(r"\W", "_", path, flags=re.ASCII)).strip("_") or "value"
        if plain[0].isdigit() or plain in KEYWORDS:
            plain = f"at_{plain}"
        name, count = plain, 1
        while name in taken:
            count += 1
            name = f"{plain}_{count}"
        taken.add(name)
        at = (place, None) if argument else (None, place)
        found.append(Member(name, path, leaf.kind or "real", leaf.shape, *at))
    return found


def dotted(name: str) -> str:
    """The dotted path of a leaf within its argument."""
    inner = FIRST.sub("", name, count=1) if FIRST.match(name) else name
    words = re.sub(r"\['?([^'\]]*)'?\]", r".\1", inner).replace(".__self__", "")
    return words.strip(".")
