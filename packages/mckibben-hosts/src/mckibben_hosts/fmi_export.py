"""Parts as functional mock-up units of FMI 3.0 and 2.0, from the same C source as all other exports.

Two C headers join the part to the functions of FMI, with the names of its structs and the table of its variables. The
archive has descriptions, sources, and a library for this machine where there is a C compiler.
"""

from __future__ import annotations

import hashlib
import html
import json
import math
import platform
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

from mckibben._jax import jax
from mckibben.documents import write_whole
from mckibben.engine.soundness import SENTENCE
from mckibben.errors import EngineError, InputError
from mckibben.recordings.provenance import versions

from .c_source import PartSource, PartVariable, build_library, c_source, compiler, shipped, with_names
from .fmi_description import (
    FmuDescription,
    FmuVariable,
    build_description,
    description_2,
    description_3,
    fmu_variables,
    terminals,
)
from .part import Part

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
    columns = "elements, kind, place, least and largest value, those without a warning, name"
    lines = [f"/* Variables by value reference: {columns}. */", "static const variable VARIABLES[] = {"]
    rows = [FmuVariable(0, "time", "TIME", "time", "s", (-math.inf, math.inf), ""), *variables]
    for v in rows:
        low, high, least, most = (_c_number(bound) for bound in (*v.bounds, *v.silent))
        place = f"offsetof(model, {v.member})"
        lines.append(f'    {{{v.reference}, {v.size}, {v.kind}, {place}, {low}, {high}, {least}, {most}, "{v.name}"}},')
    lines += ["};", "", "/* Spans and their rates by value reference. */"]
    inputs = {v.member: v.reference for v in variables if v.kind == "INPUT"}
    by_path = {v.path: inputs[f"inputs.{v.member}"] for v in source.of("inputs")}
    spans = [path for path in by_path if path.startswith("span.")]
    pairs = [f"{{{by_path[path]}, {by_path[path.replace('span.', 'rate.', 1)]}}}" for path in spans]
    lines += [f"static const struct {{ unsigned span, rate; }} SPANS[] = {{{', '.join(pairs)}}};", ""]
    if any(v.kind == "STATE" for v in variables):
        rates = {v.state: v for v in variables if v.kind == "RATE"}
        lines.append("static const continuous CONTINUOUS[] = {")
        for v in variables:
            if v.kind == "STATE":
                places = f"offsetof(model, {v.member}), offsetof(model, {rates[v.reference].member})"
                lines.append(f"    {{{places}, {v.size}, {v.nominal!r}}},")
        lines += ["};", "", *_remember(source)]
    return "\n".join(lines)


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
    untimed = "    (void)before, (void)duration; /* no memory relaxes */"
    return [*lines, "    before->duration = duration;" if timed else untimed, "}", ""]


def _assignment(member: PartVariable, struct: str, source: PartVariable) -> str:
    if member.shape:
        return f"    memcpy(before->{member.member}, {struct}->{source.member}, sizeof before->{member.member});"
    return f"    before->{member.member} = {struct}->{source.member};"


def _c_number(value: float) -> str:
    return repr(float(value)) if math.isfinite(value) else "DBL_MAX" if value > 0 else "-DBL_MAX"


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
        less = "Friction follows the importer's integrator steps in model exchange"
        sentences.append(f"{less}; co-simulation is more accurate.")
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
    code = json.dumps([part.fingerprint, version, name, source.files])
    token = "{" + hashlib.sha256(code.encode()).hexdigest()[:32] + "}"
    wrapper, memory, tool = f"fmi{version}.c", _has_memory(part), f"mckibben {versions()['mckibben']}"
    fmu = FmuDescription(
        name, part.title, part.statement, token, tool, variables, (wrapper, f"{name}.c"), exchange, memory
    )
    words = {"TITLE": part.title, "FMI_NUMBER": str(version), "WRAPPER": wrapper}
    sources = {
        **source.files,
        "model.h": model_header(source, variables, token, memory=memory),
        "variables.h": variables_header(source, variables),
        "instance.h": shipped("fmi/c/instance.h"),
        wrapper: shipped(f"fmi/c/{wrapper}"),
        **{header: shipped(f"fmi/headers/{header}") for header in HEADERS[version]},
        "exports.map": with_names(MAP, name, FMI_NUMBER=str(version)),
        "CMakeLists.txt": with_names(
            shipped("fmi/CMakeLists.txt"), name, **words, LIBRARY_FOLDER=_binary_folder(version)
        ),
    }
    files = {f"sources/{file}": text for file, text in sources.items()}
    files[f"resources/{name}.schema.json"] = source.schema()
    files["modelDescription.xml"] = description_3(fmu) if version == 3 else description_2(fmu)
    masses = ", ".join(f"{1e3 * mass:.3g} g at {1e3 * h:g} ms" for h, mass in part.smallest_masses().items())
    caution = " ".join(fmu_cautions(part)[:1])
    about = {"TITLE": part.title, "STATEMENT": part.statement, "CAUTION": caution}
    escaped = {word: html.escape(text) for word, text in about.items()}
    files["documentation/index.html"] = with_names(shipped("fmi/index.html"), name, STEPS=masses, **escaped)
    if version == 3:
        files["sources/buildDescription.xml"] = build_description(fmu)
        files["terminalsAndIcons/terminalsAndIcons.xml"] = terminals(part.muscles)
    return {path: text.encode() for path, text in files.items()}


def _has_memory(part: Part) -> bool:
    return bool(jax.tree.leaves(part.example_state.memory))


def _binary_folder(version: int) -> str:
    system, machine = platform.system().lower(), platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    if version == 3 or machine != "x86_64":
        return f"{machine}-{system}"
    return PLATFORMS_2.get(system, f"{machine}-{system}")


def _build(files: dict[str, bytes], folder: Path, name: str, version: int) -> dict[str, bytes] | None:
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
