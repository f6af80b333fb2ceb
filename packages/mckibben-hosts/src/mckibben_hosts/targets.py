"""Export of a part for another program: in C, and as a package of ROS 2; other targets have modules of their own.

For ROS 2 a part with a simple mechanism is a hardware component of ros2_control around the exported C. Controllers see
joints with position, velocity and effort, and a GPIO for each muscle with its valve, pressure, tension and span. Behind them
is no hardware but the part, which pulls at joints with the inertia, damping and gravity that the robot description states.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.assembly.build import assumption_table
from mckibben.documents import JsonValue, write_text
from mckibben.engine.soundness import SENTENCE
from mckibben.errors import InputError
from mckibben.extras import library
from mckibben.recordings.provenance import versions

from .c_source import PartSource, PartVariable, c_ends, c_source, shipped, with_names
from .fmi_export import export_fmu, fmu_cautions
from .mujoco_muscles import export_mujoco
from .part import Part
from .warp_export import export_warp


def export(part: Part, target: str, out: str | os.PathLike[str], *, name: str = "muscle_part") -> list[Path]:
    """Write a part for another program.

    Args:
        part: the part.
        target: ``c`` for a source file and a header with a description, an example and a CMake file; ``fmi3`` or ``fmi2``
            for an FMU of FMI 3.0 or 2.0; ``mujoco`` for an engine plugin of the installed MuJoCo with an example model;
            ``warp`` for a module of Python for MuJoCo Warp and Newton;
            ``ros2`` for a package of ROS 2 with a hardware component of ros2_control.
        out: folder for the files, which is made; or the FMU.
        name: beginning of all names in C, and of the names of the files.

    Returns:
        The files that were written.

    Raises:
        InputError: an unknown target, a name that C cannot have, or a part that the target cannot hold.
        EngineError: the target needs a C compiler, and there is none.
    """
    if target not in TARGETS:
        raise InputError("target", target, known=tuple(TARGETS))
    if target in LIBRARIES_OF:
        library(*LIBRARIES_OF[target])
    return TARGETS[target](c_source(part, name), Path(out))


def export_cautions(part: Part, target: str) -> list[str]:
    """What the user of an export should know, as sentences."""
    return [*map(str, part.cautions), *(fmu_cautions(part) if target in ("fmi3", "fmi2") else [])]


def describe(source: PartSource) -> dict[str, JsonValue]:
    """What the files of a part hold, for programs that read them: numbers with their units, and the masses it can move."""
    part = source.part
    return {
        "schema": 1,
        "title": part.title,
        "part": part.fingerprint,
        "made_by": f"mckibben {versions()['mckibben']}",
        "muscles": list(part.muscles),
        "commands": list(part.commands),
        "mounting": part.mounting,
        "assumptions": assumption_table(part.assumptions),
        "law_error": part.law_error,
        "warnings": [str(one) for one in part.cautions],
        "smallest_mass_kg": {f"{h:g} s": mass for h, mass in part.smallest_masses().items()},
        **{group: [_described(v) for v in source.of(group)] for group in ("parameters", "state", "inputs", "outputs")},
    }


def _described(variable: PartVariable) -> dict[str, Any]:
    low, high = (float(b) if np.isfinite(b) else None for b in variable.bounds)
    stated = {"path": variable.path, "member": variable.member, "unit": variable.unit, "meaning": variable.meaning}
    limits = {} if low is None and high is None else {"least": low, "most": high}
    shape = {"shape": list(variable.shape)} if variable.shape else {}
    default = {} if variable.default is None else {"default": variable.default}
    return stated | limits | shape | default


def _export_c(source: PartSource, out: Path) -> list[Path]:
    files = source.write(out)
    about = json.dumps(describe(source), indent=1, ensure_ascii=False) + "\n"
    files.append(write_text(out / f"{source.name}.json", about))
    first, drive = sorted(source.part.muscles)[0], source.part.hosted.drives[0]
    words = {
        "TITLE": source.part.title.replace("*/", "* /"),
        "TENSION": next(v.member for v in source.of("outputs") if v.path == f"tension.{first}"),
        "COMMAND": next(v.member for v in source.of("inputs") if v.path == f"command.{drive.command}"),
        "VALUE": "3e5" if drive.unit == "Pa" else "1.0",
    }
    for file, text in (
        ("CMakeLists.txt", shipped("c/CMakeLists.txt")),
        (f"{source.name}_example.c", shipped("c/example.c")),
    ):
        files.append(write_text(out / file, with_names(text, source.name, **words)))
    return files


STEP = 1e-3  # longest step of the mechanism [s]


def export_ros2(source: PartSource, out: Path) -> list[Path]:
    """Write a part as a package of ROS 2 with a ``SystemInterface``, and an example of a robot description.

    Args:
        source: the C of a part.
        out: folder for the files.
    """
    files = source.write(out)
    name = source.name
    for file, text in (
        (f"{name}_hardware.cpp", hardware_source(source)),
        (f"{name}_hardware.xml", with_names(shipped("ros2/hardware.xml"), name)),
        (f"{name}.ros2_control.xacro", example_description(source)),
        ("CMakeLists.txt", with_names(shipped("ros2/CMakeLists.txt"), name)),
        ("package.xml", with_names(shipped("ros2/package.xml"), name)),
    ):
        files.append(write_text(out / file, text))
    return files


def hardware_source(source: PartSource) -> str:
    """The C++ of the hardware component."""
    name, part = source.name, source.part
    members = {(v.group, v.path): v.member for v in source.variables}

    def of(group: str, path: str) -> str:
        return f"&{name}_{group}::{members[group, path]}"

    muscles, parameters = [], []
    for muscle in part.muscles:
        places = [of("inputs", f"span.{muscle}"), of("inputs", f"rate.{muscle}"), of("outputs", f"tension.{muscle}")]
        places.append(of("outputs", f"muscle.{muscle}.pressure"))
        low, high, _ = part.span_limits[muscle]
        muscles.append(f'  {{"{muscle}", {part.span[muscle]!r}, {low!r}, {high!r}, {", ".join(places)}}},')
    commands = [f'  {{"{command}", {of("inputs", f"command.{command}")}}},' for command in part.commands]
    for variable in source.of("parameters"):
        if variable.shape == ():
            path, ends = variable.path, ", ".join(c_ends(variable.bounds))
            parameters.append(f'  {{"{path}", &{name}_parameters::{variable.member}, {ends}}},')
    words: dict[str, Any] = {
        "MUSCLEROWS": "\n".join(muscles),
        "COMMANDROWS": "\n".join(commands),
        "PARAMETERROWS": "\n".join(parameters),
        "LONGEST": repr(STEP),
        "SENTENCE": json.dumps(SENTENCE.format("%g", "%s")),
    }
    return with_names(shipped("ros2/hardware.cpp"), name, **words)


def example_description(source: PartSource) -> str:
    """The part of a robot description that names the component: one joint, which all muscles move in turn to and fro."""
    part = source.part
    arms, gpios = [], []
    for place, muscle in enumerate(part.muscles):
        arms.append(f'      <param name="arm.{muscle}">{-0.02 if place % 2 else 0.02}</param>')
        inner = [f'      <param name="span">{part.span[muscle]:.6g}</param>']
        if muscle in part.commands:
            inner.append('      <command_interface name="command"/>')
        inner += [f'      <state_interface name="{shown}"/>' for shown in ("pressure", "tension", "span")]
        gpios.append(f'    <gpio name="{muscle}">\n' + "\n".join(inner) + "\n    </gpio>")
    for command in part.commands:
        if command not in part.muscles:
            gpios.append(f'    <gpio name="{command}">\n      <command_interface name="command"/>\n    </gpio>')
    return with_names(shipped("ros2/ros2_control.xacro"), source.name, ARMS="\n".join(arms), GPIOS="\n".join(gpios))


TARGETS: dict[str, Callable[[PartSource, Path], list[Path]]] = {
    "c": _export_c,
    "fmi3": lambda source, out: export_fmu(source.part, out, source.name, 3),
    "fmi2": lambda source, out: export_fmu(source.part, out, source.name, 2),
    "mujoco": export_mujoco,
    "warp": export_warp,
    "ros2": export_ros2,
}
LIBRARIES_OF = {"mujoco": ("mujoco", "The MuJoCo plugin needs")}
"""Optional libraries of targets, each with the words of the error where it is missing."""
