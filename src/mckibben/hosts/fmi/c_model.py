"""C headers that join a part to the functions of FMI: the names of its structs, and the table of its variables."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

from ...engine.soundness import SENTENCE
from ..c_source import PartSource, PartVariable
from .variables import FmuVariable

USED = ("rest", "step", "observe", "derivatives", "complete", "meaning")  # functions of the part
STRUCTS = ("parameters", "inputs", "state", "outputs", "rates", "before")


def model_header(source: PartSource, variables: Sequence[FmuVariable], token: str, *, memory: bool) -> str:
    """Names of the part's structs and functions, its defaults, and what it can do."""
    states = sum(v.size for v in variables if v.kind == "STATE")
    lines = ["/* The part behind the functions of FMI. */", "#ifndef MODEL_H", "#define MODEL_H", ""]
    lines += [f'#include "{source.name}.h"', ""]
    lines += [f"typedef {source.name}_{s} part_{s};" for s in STRUCTS if source.of(s)]
    lines += [f"#define part_{f} {source.name}_{f}" for f in USED]
    lines += [f"#define DEFAULT_{s.upper()} {source.name}_default_{s}" for s in ("parameters", "inputs")]
    lines += [f'#define TOKEN "{token}"', f"#define STATES {states}", f"#define MODEL_EXCHANGE {int(states > 0)}"]
    lines += [f"#define SENTENCE {json.dumps(SENTENCE.format('%g', '%s'))}"]
    lines += [f"#define MEMORY {int(memory)} /* friction or other memory, which moves with steps */", "", "#endif", ""]
    return "\n".join(lines)


def variables_header(source: PartSource, variables: Sequence[FmuVariable]) -> str:
    """The table of all variables, of continuous states, and of spans with their rates."""
    lines = ["/* Variables by value reference: number of elements, kind, place, least and largest value, name. */"]
    lines += ["static const variable VARIABLES[] = {"]
    rows = [FmuVariable(0, "time", "TIME", "time", "s", (-math.inf, math.inf), ""), *variables]
    for v in rows:
        low, high = (_c_number(bound) for bound in v.bounds)
        place = f"offsetof(model, {v.member})"
        lines.append(f'    {{{v.reference}, {v.size}, {v.kind}, {place}, {low}, {high}, "{v.name}"}},')
    lines += ["};", "", "/* Spans and their rates by value reference. */"]
    inputs = {v.member: v.reference for v in variables if v.kind == "INPUT"}
    by_path = {v.path: inputs[f"inputs.{v.member}"] for v in source.of("inputs")}
    spans = [path for path in by_path if path.startswith("span.")]
    pairs = [f"{{{by_path[path]}, {by_path[path.replace('span.', 'rate.', 1)]}}}" for path in spans]
    lines += [f"static const struct {{ unsigned span, rate; }} SPANS[] = {{{', '.join(pairs)}}};", ""]
    if any(v.kind == "STATE" for v in variables):
        lines += _continuous(variables) + _remember(source)
    return "\n".join(lines)


def _continuous(variables: Sequence[FmuVariable]) -> list[str]:
    """The table of continuous states."""
    rates = {v.state: v for v in variables if v.kind == "RATE"}
    lines = ["static const continuous CONTINUOUS[] = {"]
    for v in variables:
        if v.kind == "STATE":
            places = f"offsetof(model, {v.member}), offsetof(model, {rates[v.reference].member})"
            lines.append(f"    {{{places}, {v.size}, {v.nominal!r}}},")
    return [*lines, "};", ""]


def _remember(source: PartSource) -> list[str]:
    """The function that keeps what `complete` reads of the start of an integrator step."""
    states = {v.path: v for v in source.of("state")}
    inputs = {v.path: v for v in source.of("inputs")}
    lines = ["static void remember(part_before *before, const part_state *state, const part_inputs *inputs)", "{"]
    for member in source.of("before"):
        first, _, path = member.path.partition(".")
        if first == "physics":
            lines.append(_assignment(member, "state", states[member.path]))
        elif first == "inputs":
            lines.append(_assignment(member, "inputs", inputs[path]))
    lines += ["}", "", "static void set_duration(part_before *before, double duration)", "{"]
    timed = any(member.path == "duration" for member in source.of("before"))
    lines.append(
        "    before->duration = duration;" if timed else "    (void)before, (void)duration; /* no memory relaxes */"
    )
    return [*lines, "}", ""]


def _assignment(member: PartVariable, struct: str, source: PartVariable) -> str:
    if member.shape:
        return f"    memcpy(before->{member.member}, {struct}->{source.member}, sizeof before->{member.member});"
    return f"    before->{member.member} = {struct}->{source.member};"


def _c_number(value: float) -> str:
    return repr(float(value)) if math.isfinite(value) else "DBL_MAX" if value > 0 else "-DBL_MAX"
