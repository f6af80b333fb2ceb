"""A part as one file of Python for NVIDIA Warp, which needs Warp and NumPy only.

The C of the part becomes the body of a native function of Warp: structs and functions as members of one struct, since the
body stands in a function. States are rows of float64, whatever the mechanics have; the same body is compiled for processors
and, as PTX, for GPUs.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.documents import write_text
from mckibben.recordings.provenance import versions

from .c_source import PartSource, shipped, with_names
from .mujoco_muscles import actuator_roles

GROUPS = ("parameters", "inputs", "state", "timing", "outputs")
FUNCTIONS = ("rest", "advance", "step")
WHOLE_LIMITS = {
    "INT64_MAX": "9223372036854775807LL",
    "INT64_MIN": "(-9223372036854775807LL - 1)",
    "nearbyint(": "rint(",  # the same to the nearest even, and there on GPUs
}


def export_warp(source: PartSource, out: Path) -> list[Path]:
    """Write a part as a module of Python for Warp.

    Args:
        source: the C of the part.
        out: folder for the files.
    """
    out.mkdir(parents=True, exist_ok=True)
    texts = {f"{source.name}_warp.py": warp_module(source), f"{source.name}.schema.json": source.schema()}
    return [write_text(out / file, text) for file, text in texts.items()]


def warp_module(source: PartSource) -> str:
    """The text of the module."""
    part = source.part
    inputs, outputs, parameters = (source.places(group) for group in ("inputs", "outputs", "parameters"))
    defaults = np.concatenate([np.ravel(v.default) for v in source.of("parameters")]).tolist()
    roles = tuple((role.muscle, role.command) for role in actuator_roles(part))
    values: dict[str, tuple[Any, str]] = {
        "COMMANDS": (part.commands, "commands"),
        "ROLES": (roles, "muscle and command of each actuator"),
        "STATE_SIZE": (part.rest().size, "numbers of a state"),
        "PATHS": (
            {v.path: (parameters[v.path], int(np.prod(v.shape))) for v in source.of("parameters")},
            "first place and size of each parameter",
        ),
        "DEFAULTS": (defaults, "parameters [SI]"),
        "INPUTS": (inputs, "place of each input"),
        "OUTPUTS": (outputs, "place of each output"),
        "SPANS": ({name: inputs[f"span.{name}"] for name in part.muscles}, "place of each muscle's span"),
        "RATES": ({name: inputs[f"rate.{name}"] for name in part.muscles}, "place of its rate"),
        "CONTROLS": ({name: inputs[f"command.{name}"] for name in part.commands}, "place of each command"),
        "SPAN_LIMITS": (
            {name: part.span_limits[name][:2] for name in part.muscles},
            "spans that each muscle can take [m]",
        ),
        "TENSIONS": (
            {name: outputs[f"tension.{name}"] for name in part.muscles},
            "place of each muscle's mean tension",
        ),
    }
    rows = [f"{name} = {value!r}  # {meaning}" for name, (value, meaning) in values.items()]
    head = with_names(HEAD, source.name, TITLE=f"{part.title}; {part.statement}", VERSION=versions()["mckibben"])
    runtime = shipped("warp/muscles.py.txt")
    return f'{head}\n{chr(10).join(rows)}\n\nCODE = r"""\n{native_code(source)}"""\n\n\n{runtime}'


def native_code(source: PartSource) -> str:
    """The C of a part as the body of a native function of Warp that steps one row."""
    name = source.name
    header, code = (re.sub(r"/\*.*?\*/", "", source.files[f"{name}.{kind}"], flags=re.S) for kind in ("h", "c"))
    structs = {found[1]: found[0] for found in re.finditer(r"typedef struct (\w+) \{.*?\} \1;", header, flags=re.S)}
    members = [structs[f"{name}_{group}"] for group in GROUPS]
    members.append(f"enum {{ {name.upper()}_SYNCHRONOUS = 0, {name.upper()}_STAGGERED = 1 }};")
    helpers = re.findall(r"^static inline .*?^\}", code, flags=re.S | re.M)
    constants = {
        table: text for text, table in re.findall(r"^static (const \w+ (\w+)\[\d+\] = .*?;)", code, flags=re.S | re.M)
    }
    steps = [_with_constants(_function(code, f"{name}_{function}"), constants) for function in FUNCTIONS]
    members += [
        re.sub(r"^(?:static )?(?:inline )?", "CUDA_CALLABLE static inline ", text) for text in (*helpers, *steps)
    ]
    text = "\n".join(members).replace(" *restrict ", " *").replace(f"{name.upper()}_CLONES ", "")
    for old, new in WHOLE_LIMITS.items():
        text = text.replace(old, new)
    text = re.sub(r"INT64_C\((-?\d+)\)", r"\1LL", text)
    text = re.sub(r"^#ifdef \w+_TWO_ROUNDINGS\n.*?^#else\n(.*?)^#endif\n", r"\1", text, flags=re.S | re.M)
    return f"struct code {{\n{text}\n}};\n{with_names(CALL, name)}"


def _function(code: str, name: str) -> str:
    found = re.search(
        rf"^(?:static )?(?:[A-Z0-9_]+_CLONES )?void {name}\([^;{{]*\)\n\{{.*?^\}}", code, flags=re.S | re.M
    )
    assert found is not None
    return found[0].replace("static ", "", 1) if found[0].startswith("static ") else found[0]


def _with_constants(function: str, constants: Mapping[str, str]) -> str:
    """A function that holds the tables it reads itself: a struct within a function can have no constants of its own."""
    used = [text for name, text in constants.items() if re.search(rf"\b{name}\b", function)]
    return function.replace("{\n", "\n".join(["{", *used, ""]), 1)


HEAD = '''"""TITLE, for MuJoCo Warp and Newton; made by mckibben VERSION.

    muscles = MujocoMuscles(model, m, d)        # MuJoCo Warp: before the first step
    drive = newton_drive(count, arms, spans)    # Newton: for newton.actuators.Actuator
"""

import warnings

import numpy as np
import warp as wp
'''

CALL = """const int of_parameters = parameters.shape[0] > 1 ? row : 0;
const code::NAME_parameters *p = (const code::NAME_parameters *)parameters.data + of_parameters;
code::NAME_state x = ((const code::NAME_state *)state.data)[row];
code::NAME_step(p, &x, (const code::NAME_inputs *)inputs.data + row, period, code::UPPER_STAGGERED,
                (code::NAME_outputs *)outputs.data + row);
((code::NAME_state *)following.data)[row] = x;
"""
