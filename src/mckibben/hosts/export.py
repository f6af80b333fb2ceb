"""Export of a part for another program."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..assembly.build import assumption_table
from ..documents import JsonValue, write_text
from ..errors import InputError
from ..extras import library
from ..recordings.provenance import versions
from .c_source import PartSource, PartVariable, c_source, with_names
from .fmi import export_fmu, fmu_cautions
from .mujoco_export import export_mujoco
from .part import Part
from .ros2_export import export_ros2
from .warp import export_warp


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
    first = sorted(source.part.muscles)[0]
    tension = next(v.member for v in source.of("outputs") if v.path == f"tension.{first}")
    command = source.part.hosted.drives[0]
    filling = {"COMMAND": next(v.member for v in source.of("inputs") if v.path == f"command.{command.command}")}
    filling["VALUE"] = "3e5" if command.unit == "Pa" else "1.0"
    words = filling | {"TITLE": source.part.title.replace("*/", "* /"), "TENSION": tension}
    for file, text in (("CMakeLists.txt", CMAKE), (f"{source.name}_example.c", EXAMPLE)):
        files.append(write_text(out / file, with_names(text, source.name, **words)))
    return files


CMAKE = """# TITLE: a library, and an example that prints a tension
cmake_minimum_required(VERSION 3.16)
project(NAME LANGUAGES C)
set(CMAKE_C_STANDARD 99)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
add_library(NAME NAME.c)
target_include_directories(NAME PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
target_compile_options(NAME PRIVATE -ffp-contract=off)
target_link_libraries(NAME PUBLIC m)
add_executable(NAME_example NAME_example.c)
target_link_libraries(NAME_example NAME)
"""

EXAMPLE = """/* TITLE: held at the span of its start and filled for a tenth of a second. */
#include <stdio.h>
#include "NAME.h"

int main(void)
{
    NAME_state state = {0};
    NAME_inputs inputs = NAME_default_inputs;
    NAME_outputs outputs;
    inputs.COMMAND = VALUE;
    for (int k = 1; k <= 100; ++k) {
        NAME_step(&NAME_default_parameters, &state, &inputs, 1e-3, UPPER_SYNCHRONOUS, &outputs);
        if (outputs.sound != 1.0) return 1;
        if (k % 20 == 0) printf("%.3f s  %.17g N\\n", 1e-3 * k, outputs.TENSION);
    }
    return 0;
}
"""


def _export_fmi3(source: PartSource, out: Path) -> list[Path]:
    return export_fmu(source.part, out, source.name, 3)


def _export_fmi2(source: PartSource, out: Path) -> list[Path]:
    return export_fmu(source.part, out, source.name, 2)


TARGETS: dict[str, Callable[[PartSource, Path], list[Path]]] = {
    "c": _export_c,
    "fmi3": _export_fmi3,
    "fmi2": _export_fmi2,
    "mujoco": export_mujoco,
    "warp": export_warp,
    "ros2": export_ros2,
}
LIBRARIES_OF = {"mujoco": ("mujoco", "The MuJoCo plugin needs")}
"""Optional libraries of targets, each with the words of the error where it is missing."""
