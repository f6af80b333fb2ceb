"""A program as portable C99: one function for one lane, and a header with a struct for each of its arguments and results.

    sources = c_sources(program, "muscle", arguments=("parameters", "state", "inputs"), results=("state", "outputs"))

gives ``muscle.c`` and ``muscle.h`` with the structs `muscle_parameters`, `muscle_state` .. and the function

    void muscle(const muscle_parameters *, muscle_state *, const muscle_inputs *, muscle_outputs *);

A name that is both among the arguments and the results is read and then replaced: so a function of (parameters, state,
inputs) that returns (state, outputs) becomes a step that a controller calls at each sample. Members are named by their
dotted paths with underscores between the words; the header has the paths. All values are SI, as in the library.

The C allocates nothing, keeps no state of its own, and needs of the standard library only <stdint.h>, <float.h> and of
<math.h> fabs, sqrt, floor, ceil, nearbyint and fma. Loops stay loops. Scratch memory, where a program has some, is a struct
that the caller brings. Literals are decimal with all digits, which a compiler that rounds literals correctly reads exactly.

Same numbers: compiled without contraction (-ffp-contract=off; GCC with -std=c99 does so by itself), with arithmetic in the
type itself (FLT_EVAL_METHOD 0, which 32-bit x87 is not), rounding to nearest, and without -ffast-math, the results in the
modes ``default`` and ``strict`` have the same bits as those of the LLVM kernel, with both types of numbers. In mode ``fast``
reciprocals are taken together, see `passes`, whatever the processor; they differ by rounding. A processor without a fused
multiply-add takes a library call for each; where NAME_TWO_ROUNDINGS is defined when compiling, they become products and
sums, equal up to rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from .c_body import C_MEMORY, C_REALS, Real, Statements, c_literal, whole
from .c_layout import Group, Member, grouped
from .c_ops import C_HELPERS
from .graph import Buffer, Graph
from .schedule import Schedule

if TYPE_CHECKING:
    from .program import Program


def c_sources(
    program: Program, name: str, *, mode: str = "default", real: str = "float64", arguments: Sequence[str] | None = None,
    results: Sequence[str] | None = None, values: Mapping[str, Sequence[Any]] | None = None,
) -> dict[str, str]:  # fmt: skip
    """The two files of a program in C99.

    Args:
        program: what is written.
        name: of the function, the files and all names in them.
        mode: see `Program`.
        real: type of its numbers.
        arguments: what its arguments are called, in order; ``argument0`` .. where left out.
        results: what its results are called; ``result0`` .., or ``result`` of a function that returns no tuple.
        values: by name of an argument, numbers that the file is to hold, as `NAME_default_ARGUMENT`: one array per leaf.

    Returns:
        The text of ``NAME.c`` and ``NAME.h`` by file name.

    Raises:
        InputError: a name that C cannot have, names that are not as many as the arguments or results, an argument that is
            replaced by a result of other members, or values of other shapes.
    """
    groups = grouped(program, name, arguments, results)
    graph, plan = program.prepared(mode, real)
    kind = C_REALS[real]
    written = _Function(program, graph, plan, groups, name=name, real=kind)
    title = (program.title or "program").replace("*/", "* /")
    about = f"{title}, mode {mode}, {kind.type}"
    header = _header(written, about, values or {})
    source = _source(written, about, values or {})
    return {f"{name}.c": source, f"{name}.h": header}


class _Function:
    """The function with what it needs before it."""

    def __init__(
        self, program: Program, graph: Graph, plan: Schedule, groups: list[Group], *, name: str, real: Real
    ) -> None:  # fmt: skip
        self.name, self.real, self.groups = name, real, groups
        self.bases: dict[Buffer, str] = {}
        given = [b for b in graph.buffers if b.role == "argument"]
        wanted = [b for b in graph.buffers if b.role == "result"]
        named = [k for k, leaf in enumerate(program.results) if leaf.kind is not None]
        places = {k: b for k, b in zip(named, wanted, strict=True)}
        for group in groups:
            for member in group.members:
                if member.argument is not None:
                    of = f"{group.name}_before." if group.replaced else f"{group.name}->"
                    self.bases[given[member.argument]] = f"{'' if member.shape else '&'}{of}{member.name}"
                if member.result is not None:
                    self.bases[places[member.result]] = f"{'' if member.shape else '&'}{group.name}->{member.name}"
        alive = sorted(plan.live.buffers, key=lambda b: b.serial)
        self.constants = [b for b in alive if b.role == "constant"]
        self.scratch = [b for b in alive if b.role == "scratch" and b.within is None]
        self.bases.update({b: f"{name}_c{b.serial}" for b in self.constants})
        self.bases.update({b: f"scratch->s{b.serial}" for b in self.scratch})
        self.body = Statements(graph, plan, self.bases, real=real, prefix=name)
        self.read = {
            m.argument
            for g in groups
            for m in g.members
            if m.argument is not None and given[m.argument] in plan.live.buffers
        }

    def memory(self, kind: str) -> str:
        """How a kind stands in memory."""
        return C_MEMORY.get(kind, self.real.type)

    def parameters(self, *, restrict: bool) -> str:
        """Of the function."""
        mark = "restrict " if restrict else ""
        found = [
            f"{'const ' if g.given and not g.replaced else ''}{self.name}_{g.name} *{mark}{g.name}" for g in self.groups
        ]
        if self.scratch:
            found.append(f"{self.name}_scratch *{mark}scratch")
        return ", ".join(found) or "void"

    def declared(self, kind: str, name: str, shape: tuple[int, ...]) -> str:
        """A member of a struct."""
        return f"    {self.memory(kind)} {name}{f'[{int(np.prod(shape))}]' if shape else ''};"


def _header(f: _Function, about: str, values: Mapping[str, Sequence[Any]]) -> str:
    guard = f"{f.name.upper()}_H"
    lines = [f"/* {about}. No two of the structs may overlap. */", f"#ifndef {guard}", f"#define {guard}", ""]
    lines += ["#include <stdint.h>", "", "#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
    for group in f.groups:
        lines += [f"/* {group.said()} */", f"typedef struct {f.name}_{group.name} {{"]
        lines += [f.declared(m.kind, m.name, m.shape) + f" /* {_about(f, m)} */" for m in group.members]
        lines += [f"}} {f.name}_{group.name};", ""]
    if f.scratch:
        lines += [
            "/* memory that the function uses while it runs; it need not be set */",
            f"typedef struct {f.name}_scratch {{",
        ]
        lines += [f.declared(b.kind, f"s{b.serial}", (b.size,)) for b in f.scratch]
        lines += [f"}} {f.name}_scratch;", ""]
    for group in f.groups:
        if group.name in values:
            lines += [f"extern const {f.name}_{group.name} {f.name}_default_{group.name};", ""]
    lines += [f"void {f.name}({f.parameters(restrict=False)});", "", "#ifdef __cplusplus", "}", "#endif", "", "#endif"]
    return "\n".join(lines) + "\n"


def _about(f: _Function, member: Member) -> str:
    path = member.path.replace("*/", "* /")
    shape = f", {' x '.join(map(str, member.shape))} in C order" if len(member.shape) > 1 else ""
    unread = "" if member.argument is None or member.argument in f.read else "; nothing depends on it"
    return f"{path}{shape}{unread}"


def _source(f: _Function, about: str, values: Mapping[str, Sequence[Any]]) -> str:
    real = f.real
    form = {
        "p": f.name, "P": f.name.upper(), "t": real.type, "s": real.suffix, "m": real.macro,
        "i": "int32_t" if real.suffix else "int64_t", "end": c_literal(2.0**63, real),
    }  # fmt: skip
    lines = [f"/* {about}. */", f'#include "{f.name}.h"', "", "#include <float.h>", "#include <math.h>", ""]
    lines += ["#if defined(__clang__)", "#pragma STDC FP_CONTRACT OFF", "#endif", ""]
    for name in sorted(f.body.helpers):
        lines += [C_HELPERS[name].format(**form), ""]
    for buffer in f.constants:
        head = f"static const {f.memory(buffer.kind)} {f.bases[buffer]}[{buffer.size}] = "
        lines += [head + _numbers(buffer.kind, buffer.data, real) + ";", ""]
    lines += _defaults(f, values)
    lines += [f"void {f.name}({f.parameters(restrict=True)})", "{"]
    for group in f.groups:
        if group.replaced:
            lines.append(f"    const {f.name}_{group.name} {group.name}_before = *{group.name};")
        used = any(m.result is not None or m.argument in f.read for m in group.members)
        if not used or (group.replaced and not any(m.argument in f.read for m in group.members)):
            lines.append(f"    (void){group.name}{'_before' if used else ''};")
    return "\n".join([*lines, *f.body.lines, "}"]) + "\n"


def _numbers(kind: str, data: Any, real: Real) -> str:
    """An initialiser."""
    show = (lambda v: c_literal(float(v), real)) if kind == "real" else lambda v: whole(int(v))
    return "{" + ", ".join(map(show, np.asarray(data).ravel().tolist())) + "}"


def _defaults(f: _Function, values: Mapping[str, Sequence[Any]]) -> list[str]:
    """Structs with the numbers that the caller wants in the file."""
    lines: list[str] = []
    known = {g.name: g for g in f.groups if g.given}
    for name, leaves in values.items():
        if name not in known:
            raise InputError("values", name, f"known are {', '.join(known) or 'none'}")
        members = [m for m in known[name].members if m.argument is not None]
        if len(members) != len(leaves):
            raise InputError(name, f"{len(leaves)} values", f"allowed are {len(members)}, one for each member")
        lines.append(f"const {f.name}_{name} {f.name}_default_{name} = {{")
        for member, leaf in zip(members, leaves, strict=True):
            if np.shape(leaf) != member.shape:
                raise InputError(f"{name}.{member.path}", f"of shape {np.shape(leaf)}", f"allowed is {member.shape}")
            text = _numbers(member.kind, leaf, f.real)
            lines.append(f"    {text if member.shape else text[1:-1]}, /* {_about(f, member)} */")
        lines += ["};", ""]
    return lines
