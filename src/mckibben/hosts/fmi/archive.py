"""The archive of an FMU: descriptions, sources, and a library for this machine where there is a C compiler."""

from __future__ import annotations

import hashlib
import html
import json
import platform
import tempfile
import zipfile
from importlib import resources
from pathlib import Path

from ..._jax import jax
from ...documents import write_whole
from ...errors import EngineError, InputError
from ...recordings.provenance import versions
from ..c_source import PartSource, c_source, with_names
from ..compiler import build_library, compiler
from ..part import Part
from .c_model import model_header, variables_header
from .description import FmuDescription, build_description, description_2, description_3, terminals
from .variables import fmu_variables

HEADERS = {
    2: ("fmi2FunctionTypes.h", "fmi2Functions.h", "fmi2TypesPlatform.h"),
    3: ("fmi3FunctionTypes.h", "fmi3Functions.h", "fmi3PlatformTypes.h"),
}
PLATFORMS_2 = {"linux": "linux64", "windows": "win64", "darwin": "darwin64"}
SUFFIXES = {"linux": ".so", "windows": ".dll", "darwin": ".dylib"}
MOMENT = (1980, 1, 1, 0, 0, 0)  # of all files in the archive: the same part gives the same bytes
MAP = "{ global: fmiFMI_NUMBER*; local: *; };\n"  # what the library offers: two FMUs in one process do not mix


def export_fmu(part: Part, out: Path, name: str, version: int) -> list[Path]:
    """Write a part as an FMU.

    Args:
        part: the part.
        out: path of the file; ``.fmu`` is added where it has no suffix.
        name: identifier of the model, and beginning of all names in C.
        version: 2 for FMI 2.0, 3 for FMI 3.0.

    Returns:
        The file.

    Raises:
        InputError: the path ends in another suffix, or the name is none that C can have.
        EngineError: the compiler fails.
    """
    if out.suffix not in ("", ".fmu"):
        raise InputError("out", str(out), "must end in .fmu")
    files = fmu_files(part, name, version)
    with tempfile.TemporaryDirectory(prefix="mckibben-") as folder:
        library = _build(files, Path(folder), name, version)
        if library is not None:
            files |= library
    return [write_whole(out.with_suffix(".fmu"), lambda path: _pack(files, path), field="out")]


def fmu_cautions(part: Part) -> list[str]:
    """What the user of a part's FMU should know, as sentences."""
    sentences = []
    if part.hosted.late:
        sentences.append("The FMU has co-simulation only, since an element of the part has dead time.")
    elif _has_memory(part):
        sentences.append(
            "Friction follows the importer's integrator steps in model exchange; co-simulation is more accurate."
        )
    try:
        compiler()
    except EngineError:
        sentences.append("The FMU has no binary, since there is no C compiler here; the importer compiles its sources.")
    return sentences


def fmu_files(part: Part, name: str, version: int) -> dict[str, bytes]:
    """The files of a part's FMU but the library, by their path in the archive."""
    exchange = not part.hosted.late
    source = c_source(part, name, integrated=exchange)
    variables = fmu_variables(source, states=exchange)
    token = _token(source, version)
    wrapper = f"fmi{version}.c"
    memory = _has_memory(part)
    fmu = FmuDescription(
        name,
        part.title,
        part.statement,
        token,
        f"mckibben {versions()['mckibben']}",
        variables,
        (wrapper, f"{name}.c"),
        exchange,
        memory,
    )
    words = {"TITLE": part.title, "FMI_NUMBER": str(version), "WRAPPER": wrapper}
    sources = {
        **source.files,
        "model.h": model_header(source, variables, token, memory=memory),
        "variables.h": variables_header(source, variables),
        "instance.h": _shipped("c", "instance.h"),
        wrapper: _shipped("c", wrapper),
        **{header: _shipped("headers", header) for header in HEADERS[version]},
        "exports.map": with_names(MAP, name, FMI_NUMBER=str(version)),
        "CMakeLists.txt": with_names(CMAKE, name, **words, LIBRARY_FOLDER=_binary_folder(version)),
    }
    files = {f"sources/{file}": text for file, text in sources.items()}
    files["modelDescription.xml"] = description_3(fmu) if version == 3 else description_2(fmu)
    files["documentation/index.html"] = with_names(
        DOCUMENTATION,
        name,
        TITLE=html.escape(part.title),
        STEPS=_steps(part),
        STATEMENT=html.escape(part.statement),
        CAUTION=html.escape(" ".join(fmu_cautions(part)[:1])),
    )
    if version == 3:
        files["sources/buildDescription.xml"] = build_description(fmu)
        files["terminalsAndIcons/terminalsAndIcons.xml"] = terminals(part.muscles)
    return {path: text.encode() for path, text in files.items()}


def _has_memory(part: Part) -> bool:
    return bool(jax.tree.leaves(part.example_state.memory))


def _shipped(folder: str, file: str) -> str:
    return resources.files(__package__).joinpath(folder, file).read_text(encoding="utf-8")


def _token(source: PartSource, version: int) -> str:
    """Hash of the part and its code."""
    code = json.dumps([source.part.fingerprint, version, source.name, source.files])
    return "{" + hashlib.sha256(code.encode()).hexdigest()[:32] + "}"


def _steps(part: Part) -> str:
    return ", ".join(f"{1e3 * mass:.3g} g at {1e3 * h:g} ms" for h, mass in part.smallest_masses().items())


def _binary_folder(version: int) -> str:
    """Folder of the library for this machine."""
    system, machine = platform.system().lower(), platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    if version == 3 or machine != "x86_64":
        return f"{machine}-{system}"
    return PLATFORMS_2.get(system, f"{machine}-{system}")


def _build(files: dict[str, bytes], folder: Path, name: str, version: int) -> dict[str, bytes] | None:
    """The library for this machine; None where there is no compiler."""
    try:
        compiler()
    except EngineError:
        return None
    for path, content in files.items():
        if path.startswith("sources/"):
            (folder / Path(path).name).write_bytes(content)
    library = folder / f"{name}{SUFFIXES.get(platform.system().lower(), '.so')}"
    link = [f"-Wl,--version-script={folder / 'exports.map'}"] if platform.system() == "Linux" else []
    build_library([folder / f"fmi{version}.c", folder / f"{name}.c"], library, include=[folder], link=link)
    return {f"binaries/{_binary_folder(version)}/{library.name}": library.read_bytes()}


def _pack(files: dict[str, bytes], path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, MOMENT)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, files[name])


CMAKE = """# TITLE: the library of an FMU of FMI FMI_NUMBER.0, to be put into its folder binaries/LIBRARY_FOLDER
cmake_minimum_required(VERSION 3.16)
project(NAME LANGUAGES C)
set(CMAKE_C_STANDARD 99)
set(CMAKE_C_VISIBILITY_PRESET hidden)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
add_library(NAME SHARED WRAPPER NAME.c)
set_target_properties(NAME PROPERTIES PREFIX "")
if(NOT MSVC)
  target_compile_options(NAME PRIVATE -ffp-contract=off)
  target_link_libraries(NAME PRIVATE m)
endif()
if(UNIX AND NOT APPLE)
  target_link_options(NAME PRIVATE "-Wl,--version-script=${CMAKE_CURRENT_SOURCE_DIR}/exports.map")
endif()
"""

DOCUMENTATION = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>TITLE</title>
<h1>TITLE</h1>
<p>McKibben muscles with their air as a part of a simulation: spans in, tensions out. CAUTION</p>
<p>STATEMENT.</p>
<h2>Co-simulation</h2>
<ul>
<li>Give each <code>span</code>, from the anchor to the attachment of the mechanism, and its <code>rate</code>,
both at the start of the step; commands hold over the step.</li>
<li>Step the muscle first, then the mechanism with the <code>tension</code> of the same step. It is the mean
over the step, and the coupling is of second order. Steps in parallel, with the tension of the step before, pump
energy into the mechanism.</li>
<li>Set <code>staggered</code> to 1 if the mechanism is integrated by the semi-implicit Euler method.</li>
<li>The part begins at rest at the spans and commands of the initialization.</li>
<li>Estimate of the smallest mass at the end of a muscle that an explicit step can move: STEPS.</li>
</ul>
<p>Names, units and limits of all variables are in <code>modelDescription.xml</code>; the C sources and a CMake file are in
<code>sources</code>.</p>
</html>
"""
