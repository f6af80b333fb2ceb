"""A program as portable C99: one function for one lane, and a header with a struct for each of its arguments and results.

    sources = to_c(program, "tank", arguments=("parameters", "state", "inputs"), results=("state", "outputs"))

gives ``tank.c`` and ``tank.h`` with the structs `tank_parameters`, `tank_state` .. and the function

    void tank(const tank_parameters *, tank_state *, const tank_inputs *, tank_outputs *);

A name that is both among the arguments and the results is read and then replaced: so a function of (parameters, state,
inputs) that returns (state, outputs) becomes a step that a controller calls at each sample. Members are named by their
dotted paths with underscores between the words; the header has the paths.
The C allocates nothing, keeps no state of its own, and needs of the standard library only <stdint.h>, <float.h> and of
<math.h> fabs, sqrt, floor, ceil, nearbyint and fma. Loops stay loops. Scratch memory, where a program has some, is a struct
that the caller brings. Literals are decimal with all digits, which a compiler that rounds literals correctly reads exactly.

`to_c_library` writes several programs into one pair of files over shared structs: the functions of a model that
initialises, steps and observes one state. Parameters that none of them reads are left out.

Same numbers: compiled without contraction (-ffp-contract=off; GCC with -std=c99 does so by itself), with arithmetic in the
type itself (FLT_EVAL_METHOD 0, which 32-bit x87 is not), rounding to nearest, and without -ffast-math, the results in the
modes ``default`` and ``strict`` have the same bits as those of the LLVM kernel, with both types of numbers. In mode ``fast``
reciprocals are taken together, see `_passes`, whatever the processor; they differ by rounding. A processor without a fused
multiply-add takes a library call for each; where NAME_TWO_ROUNDINGS is defined when compiling, they become products and
sums, equal up to rounding.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ._analysis import Schedule
from ._c_text import C_HELPERS, C_MEMORY, C_REALS, Real, Statements, c_literal, whole
from ._graph import Buffer, Graph
from ._program import Leaf, Program
from .errors import ArgumentError

# ---- structs


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
        kind: kind of its numbers.
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
    def is_read(self) -> bool:
        """Whether the function reads it."""
        return any(m.argument is not None for m in self.members)

    @property
    def is_replaced(self) -> bool:
        """Whether the function reads and overwrites it."""
        return self.is_read and any(m.result is not None for m in self.members)

    def describe(self) -> str:
        """Describe how the group is used."""
        return f"{self.name}: " + ("read, then replaced" if self.is_replaced else "read" if self.is_read else "written")


def make_groups(
    program: Program, name: str, arguments: Sequence[str] | None, results: Sequence[str] | None
) -> list[Group]:
    """The structs of a program; an argument or result without numbers has none.

    Raises:
        ArgumentError: see `to_c`.
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
    """Refuse a result that does not match the argument it replaces."""
    places = [{m.path: (m.kind, m.shape) for m in members} for members in (before, after)]
    for path in (*places[0], *places[1]):
        if places[0].get(path) != places[1].get(path):
            raise ArgumentError(
                "results",
                f"results must replace arguments of the same members: {path or 'the value'} of {called!r} differs",
            )


def _identifier(field: str, name: str) -> None:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or name in KEYWORDS or OWN.fullmatch(name):
        raise ArgumentError(
            field,
            f"{field} must be a name in C (letters, digits and _, no keyword, no letter with a number), got {name!r}",
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
        raise ArgumentError(field, f"{field} must be {count} names, got {len(names)}")
    for name in names:
        _identifier(field, name)
    if len(set(names)) < len(names):
        raise ArgumentError(field, f"{field} must be names that differ, got {', '.join(names)}")
    places: dict[str, list[int]] = {name: [] for name in names}
    for place, number in enumerate(numbers):
        if leaves[place].kind is not None:
            places[names[number]].append(place)
    return places


def _members(leaves: Sequence[Leaf], places: Sequence[int], *, argument: bool) -> list[Member]:
    members: list[Member] = []
    taken: set[str] = set()
    for place in places:
        leaf = leaves[place]
        path = dotted_path(leaf.name)
        plain = re.sub(r"_+", "_", re.sub(r"\W", "_", path, flags=re.ASCII)).strip("_") or "value"
        if plain[0].isdigit() or plain in KEYWORDS:
            plain = f"at_{plain}"
        name, count = plain, 1
        while name in taken:
            count += 1
            name = f"{plain}_{count}"
        taken.add(name)
        at = (place, None) if argument else (None, place)
        members.append(Member(name, path, leaf.kind or "real", leaf.shape, *at))
    return members


def dotted_path(name: str) -> str:
    """The dotted path of a leaf within its argument."""
    inner = FIRST.sub("", name, count=1) if FIRST.match(name) else name
    words = re.sub(r"\['?([^'\]]*)'?\]", r".\1", inner).replace(".__self__", "")
    return words.strip(".")


# ---- source and header


def to_c(
    program: Program,
    name: str,
    *,
    mode: str = "default",
    real: str = "float64",
    arguments: Sequence[str] | None = None,
    results: Sequence[str] | None = None,
    values: Mapping[str, Sequence[ArrayLike]] | None = None,
) -> dict[str, str]:
    """The two files of a program in C99.

    Args:
        program: the program.
        name: name of the function, the files and all names in them.
        mode: see `Program`.
        real: type of its numbers.
        arguments: what its arguments are called, in order; ``argument0`` .. by default.
        results: what its results are called; ``result0`` .., or ``result`` of a function that returns no tuple.
        values: by name of an argument, numbers that the file is to hold, as `NAME_default_ARGUMENT`: one array per leaf.

    Returns:
        The text of ``NAME.c`` and ``NAME.h`` by file name.

    Raises:
        ArgumentError: a name that C cannot have, names that are not as many as the arguments or results, an argument that is
            replaced by a result of other members, or values of other shapes.
    """
    groups = make_groups(program, name, arguments, results)
    graph, plan = program.prepared(mode, real)
    kind = C_REALS[real]
    written = _FunctionText(program, graph, plan, groups, name=name, real=kind)
    title = (program.title or "program").replace("*/", "* /")
    about = f"{title}, mode {mode}, {kind.type}"
    header = _header(written, about, values or {})
    source = _source(written, about, values or {})
    return {f"{name}.c": source, f"{name}.h": header}


class _FunctionText:
    """A function with what it needs before it.

    Attributes:
        name: of the function, with which its constants begin.
        library: name with which structs and helpers begin, that of the function where it stands alone.
    """

    def __init__(
        self,
        program: Program,
        graph: Graph,
        plan: Schedule,
        groups: list[Group],
        *,
        name: str,
        real: Real,
        library: str | None = None,
    ) -> None:
        self.name, self.real, self.groups = name, real, groups
        self.library = name if library is None else library
        self.bases: dict[Buffer, str] = {}
        inputs = [b for b in graph.buffers if b.role == "argument"]
        wanted = [b for b in graph.buffers if b.role == "result"]
        named = [k for k, leaf in enumerate(program.results) if leaf.kind is not None]
        places = {k: b for k, b in zip(named, wanted, strict=True)}
        for group in groups:
            for member in group.members:
                if member.argument is not None:
                    of = f"{group.name}_before." if group.is_replaced else f"{group.name}->"
                    self.bases[inputs[member.argument]] = f"{'' if member.shape else '&'}{of}{member.name}"
                if member.result is not None:
                    self.bases[places[member.result]] = f"{'' if member.shape else '&'}{group.name}->{member.name}"
        alive = sorted(plan.live.buffers, key=lambda b: b.serial)
        self.constants = [b for b in alive if b.role == "constant"]
        self.scratch = [b for b in alive if b.role == "scratch" and b.within is None]
        self.bases.update({b: f"{name}_c{b.serial}" for b in self.constants})
        self.bases.update({b: f"scratch->s{b.serial}" for b in self.scratch})
        self.body = Statements(graph, plan, self.bases, real=real, prefix=self.library)
        self.read = {
            m.argument
            for g in groups
            for m in g.members
            if m.argument is not None and inputs[m.argument] in plan.live.buffers
        }

    def memory(self, kind: str) -> str:
        """C type of a kind in memory."""
        return C_MEMORY.get(kind, self.real.type)

    def parameters(self, *, restrict: bool) -> str:
        """Parameters of the function."""
        mark = "restrict " if restrict else ""
        parameters = [
            f"{'const ' if g.is_read and not g.is_replaced else ''}{self.library}_{g.name} *{mark}{g.name}"
            for g in self.groups
        ]
        if self.scratch:
            parameters.append(f"{self.name}_scratch *{mark}scratch")
        return ", ".join(parameters) or "void"

    def declared(self, kind: str, name: str, shape: tuple[int, ...]) -> str:
        """A member of a struct."""
        return f"    {self.memory(kind)} {name}{f'[{int(np.prod(shape))}]' if shape else ''};"


def _header(f: _FunctionText, about: str, values: Mapping[str, Sequence[ArrayLike]]) -> str:
    guard = f"{f.name.upper()}_H"
    lines = [f"/* {about}. No two of the structs may overlap. */", f"#ifndef {guard}", f"#define {guard}", ""]
    lines += ["#include <stdint.h>", "", "#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
    for group in f.groups:
        lines += [f"/* {group.describe()} */", f"typedef struct {f.name}_{group.name} {{"]
        lines += [f.declared(m.kind, m.name, m.shape) + f" /* {_about(f, m)} */" for m in group.members]
        lines += [f"}} {f.name}_{group.name};", ""]
    lines += _scratch(f)
    for group in f.groups:
        if group.name in values:
            lines += [f"extern const {f.name}_{group.name} {f.name}_default_{group.name};", ""]
    lines += [f"void {f.name}({f.parameters(restrict=False)});", "", "#ifdef __cplusplus", "}", "#endif", "", "#endif"]
    return "\n".join(lines) + "\n"


def _scratch(f: _FunctionText) -> list[str]:
    """The struct of a function's scratch memory, if it needs some."""
    if not f.scratch:
        return []
    members = [f.declared(b.kind, f"s{b.serial}", (b.size,)) for b in f.scratch]
    head = "/* memory that the function uses while it runs; it need not be set */"
    return [head, f"typedef struct {f.name}_scratch {{", *members, f"}} {f.name}_scratch;", ""]


def _about(f: _FunctionText, member: Member) -> str:
    path = member.path.replace("*/", "* /")
    shape = f", {' x '.join(map(str, member.shape))} in C order" if len(member.shape) > 1 else ""
    unread = "" if member.argument is None or member.argument in f.read else "; nothing depends on it"
    return f"{path}{shape}{unread}"


def _source(f: _FunctionText, about: str, values: Mapping[str, Sequence[ArrayLike]]) -> str:
    lines = _beginning(about, f.name, f.body.helpers, f.library, f.real)
    constants, function = _definition(f)
    defaults = _defaults(f.name, f.real, _known_arguments([f], values), values, lambda _, m: _about(f, m))
    return "\n".join([*lines, *constants, *defaults, *function]) + "\n"


def _beginning(about: str, file: str, helpers: Iterable[str], prefix: str, real: Real) -> list[str]:
    """The head of a source file, and the helper functions."""
    form = {
        "p": prefix,
        "P": prefix.upper(),
        "t": real.type,
        "s": real.suffix,
        "m": real.macro,
        "i": "int32_t" if real.suffix else "int64_t",
        "end": c_literal(2.0**63, real),
    }
    lines = [f"/* {about}. */", f'#include "{file}.h"', "", "#include <float.h>", "#include <math.h>", ""]
    lines += ["#if defined(__clang__)", "#pragma STDC FP_CONTRACT OFF", "#endif", ""]
    for name in sorted(helpers):
        lines += [C_HELPERS[name].format(**form), ""]
    return lines


def _definition(f: _FunctionText, before: str = "") -> tuple[list[str], list[str]]:
    """The constants of a function, and the function itself behind a word such as ``static``."""
    constants = []
    for buffer in f.constants:
        head = f"static const {f.memory(buffer.kind)} {f.bases[buffer]}[{buffer.size}] = "
        constants += [head + _numbers(buffer.kind, buffer.data, f.real) + ";", ""]
    lines = [f"{before}void {f.name}({f.parameters(restrict=True)})", "{"]
    for group in f.groups:
        if group.is_replaced:
            lines.append(f"    const {f.library}_{group.name} {group.name}_before = *{group.name};")
        used = any(m.result is not None or m.argument in f.read for m in group.members)
        if not used or (group.is_replaced and not any(m.argument in f.read for m in group.members)):
            lines.append(f"    (void){group.name}{'_before' if used else ''};")
    return constants, [*lines, *f.body.lines, "}"]


def _numbers(kind: str, data: Any, real: Real) -> str:
    """An initialiser."""
    show = (lambda v: c_literal(float(v), real)) if kind == "real" else lambda v: whole(int(v))
    return "{" + ", ".join(map(show, np.asarray(data).ravel().tolist())) + "}"


def _known_arguments(
    functions: Sequence[_FunctionText], values: Mapping[str, Sequence[ArrayLike]]
) -> dict[str, list[Member]]:
    """Members of the arguments by name; refuses values of others, and values of other shapes."""
    known = {g.name: [m for m in g.members if m.argument is not None] for f in functions for g in f.groups if g.is_read}
    for name, leaves in values.items():
        if name not in known:
            raise ArgumentError(
                "values", f"Unknown argument {name!r} in values. Known are {', '.join(known) or 'none'}"
            )
        if len(known[name]) != len(leaves):
            count = len(known[name])
            raise ArgumentError(name, f"{name} must be {count} values, one for each member, got {len(leaves)}")
        for member, leaf in zip(known[name], leaves, strict=True):
            if np.shape(leaf) != member.shape:
                raise ArgumentError(
                    member.path, f"{name}.{member.path} must have the shape {member.shape}, got {np.shape(leaf)}"
                )
    return known


def _defaults(
    prefix: str,
    real: Real,
    known: Mapping[str, Sequence[Member]],
    values: Mapping[str, Sequence[ArrayLike]],
    about: Callable[[str, Member], str],
    left_out: Container[tuple[str, str]] = (),
) -> list[str]:
    """Structs with the numbers that the caller wants in the file."""
    lines: list[str] = []
    for name, leaves in values.items():
        lines.append(f"const {prefix}_{name} {prefix}_default_{name} = {{")
        for member, leaf in zip(known[name], leaves, strict=True):
            if (name, member.path) in left_out:
                continue
            text = _numbers(member.kind, leaf, real)
            lines.append(f"    {text if member.shape else text[1:-1]}, /* {about(name, member)} */")
        lines += ["};", ""]
    return lines


# ---- several functions over shared structs


class CFunction(NamedTuple):
    """A program as a function of a library in C, and what its arguments and results are called, see `to_c`."""

    program: Program
    arguments: Sequence[str]
    results: Sequence[str]


class CLibrary(NamedTuple):
    """Several functions in C over shared structs.

    Attributes:
        source: text of the .c file.
        header: text of the .h file.
        structs: members of each struct, in the order in which they lie there.
    """

    source: str
    header: str
    structs: dict[str, list[Member]]


def to_c_library(
    functions: Mapping[str, CFunction],
    name: str,
    *,
    mode: str = "default",
    real: str = "float64",
    values: Mapping[str, Sequence[ArrayLike]] | None = None,
    about: Callable[[str, str], str] | None = None,
    title: str = "",
    extern: Container[str] | None = None,
) -> CLibrary:
    """Several programs in C99, in one source file and one header.

    Arguments and results of one name are one struct ``NAME_ARGUMENT``, whatever the function. Of a struct that functions
    only read, it has the members that some function reads, and no others. Functions compiled for x86-64 by GCC on Linux
    are compiled for processors with and without a fused multiply-add, of which the loader takes the faster; define
    NAME_CLONES as nothing to have one.

    Args:
        functions: by name; the function in C is ``NAME_FUNCTION``.
        name: name of the files, and the beginning of all names in them.
        mode: see `Program`.
        real: type of the numbers.
        values: by name of an argument, numbers that the source is to hold, as in `to_c`.
        about: what the header says of a member, from the name of its struct and its dotted path; the path by default.
        title: first words of both files.
        extern: functions that others may call; the rest are ``static``. All by default.

    Returns:
        Texts, and the structs.

    Raises:
        ArgumentError: as `to_c`, or functions whose structs of one name differ.
    """
    texts, structs = {}, dict[str, list[Member]]()
    for called, (program, arguments, results) in functions.items():
        _identifier("functions", called)
        groups = make_groups(program, name, arguments, results)
        graph, plan = program.prepared(mode, real)
        kind = C_REALS[real]
        texts[called] = _FunctionText(program, graph, plan, groups, name=f"{name}_{called}", real=kind, library=name)
        for group in groups:
            members = structs.setdefault(group.name, group.members)
            if [(m.name, m.path, m.kind, m.shape) for m in members] != [
                (m.name, m.path, m.kind, m.shape) for m in group.members
            ]:
                raise ArgumentError(
                    "functions",
                    f"{group.name} must have the same members in all functions; those of {called!r} differ",
                )
    for called in texts.keys() & structs.keys():
        raise ArgumentError("functions", f"A function must have another name than a struct; both are called {called!r}")
    left_out = _never_read(texts.values())
    known = _known_arguments(list(texts.values()), values or {})
    kept = {g: [m for m in members if (g, m.path) not in left_out] for g, members in structs.items()}
    said = about or (lambda group, path: path)
    kind = C_REALS[real]
    head = f"{(title or name).replace('*/', '* /')}, mode {mode}, {kind.type}"
    macro = f"{name.upper()}_CLONES"
    helpers = {h for f in texts.values() for h in f.body.helpers}
    source = [*_beginning(head, name, helpers, name, kind), *_clones(macro)]

    def comment(group: str, member: Member) -> str:
        return said(group, member.path).replace("*/", "* /")

    source += _defaults(name, kind, known, values or {}, comment, left_out)
    for called, f in texts.items():
        hidden = extern is not None and called not in extern
        constants, function = _definition(f, f"{'static ' if hidden else ''}{macro} ")
        source += [*constants, *function, ""]
    guard = f"{name.upper()}_H"
    header = [f"/* {head}. No two of the structs may overlap. */", f"#ifndef {guard}", f"#define {guard}", ""]
    header += ["#include <stdint.h>", "", "#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
    declared = next(iter(texts.values())).declared
    for struct, members in kept.items():
        if members:
            lines = [f"{declared(m.kind, m.name, m.shape)} /* {comment(struct, m)} */" for m in members]
            header += [f"typedef struct {name}_{struct} {{", *lines, f"}} {name}_{struct};", ""]
    header += [line for f in texts.values() for line in _scratch(f)]
    header += [f"extern const {name}_{argument} {name}_default_{argument};" for argument in values or {}]
    header += [
        f"void {f.name}({f.parameters(restrict=False)});"
        for called, f in texts.items()
        if extern is None or called in extern
    ]
    header += ["", "#ifdef __cplusplus", "}", "#endif", "", "#endif"]
    return CLibrary("\n".join(source) + "\n", "\n".join(header) + "\n", kept)


def _never_read(functions: Iterable[_FunctionText]) -> set[tuple[str, str]]:
    """Members of structs that are read only, which no function reads, by struct and path."""
    unread: set[tuple[str, str]] = set()
    needed: set[tuple[str, str]] = set()
    for f in functions:
        for group in f.groups:
            for member in group.members:
                read = member.argument is not None and member.argument in f.read
                (needed if read or member.result is not None else unread).add((group.name, member.path))
    return unread - needed


def _clones(macro: str) -> list[str]:
    """The attribute that lets GCC compile a function for several processors."""
    return [
        f"#ifndef {macro}",
        "#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__) && !defined(__FMA__)",
        f'#define {macro} __attribute__((target_clones("default", "fma")))',
        "#else",
        f"#define {macro}",
        "#endif",
        "#endif",
        "",
    ]
