"""A part as C: one source file and one header, with structs that say what every number is.

    NAME_step(&NAME_default_parameters, &state, &inputs, 1e-3, NAME_SYNCHRONOUS, &outputs);

The code allocates nothing, has no state of its own, and its state has no pointers: it may be copied with `memcpy`, kept,
and brought back. A state of zeros is one that was never set; the part then rests at the span and command of its first step.
Hosts that need a part as a library have it built by the C compiler of this machine.
"""

from __future__ import annotations

import functools
import json
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import lanewise
from mckibben._jax import jax
from mckibben.components.programs import lower_or_load
from mckibben.documents import write_text
from mckibben.engine.soundness import MEANINGS
from mckibben.errors import EngineError, InputError

from .coupling import HostStep, IntegratorStep, advance, complete, observe, rates, rest
from .part import MODE, Part

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")  # no contraction: the same bits on every processor


def compiler() -> list[str]:
    """Command of the compiler: that of the variable CC, else cc, gcc or clang.

    Raises:
        EngineError: there is none.
    """
    if stated := os.environ.get("CC"):
        return shlex.split(stated)
    for name in ("cc", "gcc", "clang"):
        if path := shutil.which(name):
            return [path]
    raise EngineError("No C compiler found: install gcc or clang, or name one in the environment variable CC.")


def compiler_version() -> str:
    """Name and version of the compiler, the first line that it prints of itself."""
    done = subprocess.run([*compiler(), "--version"], capture_output=True, text=True, check=False)
    return done.stdout.splitlines()[0] if done.stdout else compiler()[0]


def build_library(
    sources: Iterable[Path], library: Path, *, include: Iterable[Path] = (), link: Iterable[str] = ()
) -> Path:
    """Compile C sources to a shared library, with the flags of the variable CFLAGS behind those of the package.

    Args:
        sources: the sources.
        library: path of the library; replaced as a whole.
        include: folders of headers.
        link: further arguments of the linker.

    Returns:
        The library.

    Raises:
        EngineError: no compiler, or the first error that it reports.
    """
    made = library.with_name(f"{library.name}.{os.getpid()}.new")
    words = [
        *compiler(),
        *FLAGS,
        *shlex.split(os.environ.get("CFLAGS", "")),
        *(f"-I{folder}" for folder in include),
        *map(str, sources),
        "-o",
        str(made),
        *link,
        "-lm",
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        errors = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines()
        raise EngineError(f"The C compiler failed on {library.name}: {errors[0] if errors else 'no message'}.")
    os.replace(made, library)
    return library


RESULTS = ("state", "outputs")
UNITS_OF_OUTPUTS = {
    "tension": ("N", "mean tension over the step, with which a mechanism is to be stepped"),
    "tension_end": ("N", "tension at the end of the step"),
    "pressure": ("Pa", "gauge pressure of the gas"),
    "length": ("m", "length of the braid"),
    "velocity": ("m/s", "rate of the braid's length, negative while it shortens"),
    "volume": ("m^3", "volume of the braid"),
    "temperature": ("K", "temperature of the gas"),
    "friction": ("N", "friction and creep of the braid, positive when they oppose lengthening"),
    "slack": ("1", "1 where the muscle is slack, else 0"),
    "work": ("J", "work of the host on the muscle since the start"),
    "rate_bound": ("1/s", "bound of the fastest mode"),
    "sound": ("1", "1 where the step can be relied on, else a code that says why not"),
}
UNITS_OF_STATES = {
    "mass": ("kg", "mass of the gas"),
    "pressure": ("Pa", "absolute pressure of the gas"),
    "length": ("m", "length of the braid"),
    "velocity": ("m/s", "rate of the braid's length"),
    "sag": ("m", "length of the braid beyond its span, 0 while it is taut"),
}


class PartVariable(NamedTuple):
    """A number or an array of numbers at the border of a part.

    Attributes:
        group: struct that holds it: ``parameters``, ``state``, ``inputs``, ``outputs``, ``rates`` or ``before``.
        member: name of the member in C.
        path: dotted path, by which users name it.
        unit: SI unit; empty where none is declared.
        bounds: least and largest value.
        meaning: one phrase.
        default: value at the start; empty for outputs.
        shape: () for a number.
    """

    group: str
    member: str
    path: str
    unit: str
    bounds: tuple[float, float]
    meaning: str
    default: Any
    shape: tuple[int, ...]


@dataclass(frozen=True)
class PartSource:
    """The C of a part.

    Attributes:
        name: beginning of all names.
        part: the part.
        files: text of each file by its name.
        variables: all numbers at the border, in the order of their structs.
    """

    name: str
    part: Part
    files: dict[str, str]
    variables: tuple[PartVariable, ...]

    def of(self, group: str) -> list[PartVariable]:
        """The variables of a struct."""
        return [v for v in self.variables if v.group == group]

    def places(self, group: str) -> dict[str, int]:
        """Where the numbers of a struct begin, by dotted path."""
        places, at = {}, 0
        for variable in self.of(group):
            places[variable.path] = at
            at += int(np.prod(variable.shape))
        return places

    def write(self, folder: Path) -> list[Path]:
        """Write the files into a folder, each whole or not at all."""
        folder.mkdir(parents=True, exist_ok=True)
        whole = {**self.files, f"{self.name}.schema.json": self.schema()}
        return [write_text(folder / name, text) for name, text in whole.items()]

    def schema(self) -> str:
        """A JSON Schema of the parameters, for programs that vary or identify them.

        Each has its dotted path as name, its unit as ``unit``, its meaning, bounds and default.
        """
        properties = {}
        for one in self.of("parameters"):
            ends = {name: float(end) for name, end in zip(("minimum", "maximum"), one.bounds, strict=True)}
            number: dict[str, Any] = {"type": "number", **{n: end for n, end in ends.items() if np.isfinite(end)}}
            for size in reversed(one.shape):
                number = {"type": "array", "items": number, "minItems": size, "maxItems": size}
            about = {"description": one.meaning, "unit": one.unit or "1", "default": np.asarray(one.default).tolist()}
            properties[one.path] = {**number, **about}
        whole = {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": f"Parameters of {self.part.title}",
            "type": "object",
            "properties": properties,
            "additionalProperties": False,
        }
        return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def c_source(part: Part, name: str = "muscle_part", *, integrated: bool = False) -> PartSource:
    """The C of a part.

    Args:
        part: the part.
        name: beginning of all names, and name of the files.
        integrated: whether hosts that integrate the part's states themselves get NAME_complete, which takes friction and
            other memory along a step that they have integrated.

    Raises:
        InputError: the name is none that C can have.
        EngineError: the part cannot be lowered.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,40}", name):
        raise InputError("name", name, "must be lower-case letters, digits and _, beginning with a letter")
    zero = {group: 0.0 for group in part.commands}
    hosted, inputs = part.hosted, part.inputs(part.span, dict.fromkeys(part.muscles, 0.0), zero | part.command)
    state, timing = part.example_state, HostStep(np.float64(1e-3), np.float64(0.0))
    both = ("parameters", "state", "inputs")
    plan: dict[str, tuple[Any, tuple[Any, ...], tuple[str, ...], tuple[str, ...]]] = {
        "rest": (rest, (hosted, inputs), ("parameters", "inputs"), ("state",)),
        "advance": (advance, (hosted, state, inputs, timing), (*both, "timing"), RESULTS),
        "observe": (observe, (hosted, state, inputs), both, ("outputs",)),
        "derivatives": (rates, (hosted, state, inputs), both, ("rates",)),
    }
    if integrated:
        before = IntegratorStep(state.physics, inputs, np.float64(1e-3))
        plan["complete"] = (complete, (hosted, state, inputs, before), (*both, "before"), RESULTS)
    functions = {}
    for called, (function, examples, arguments, results) in plan.items():
        # One result stands in a tuple, so that it has a name of its own.
        wrapped = functools.partial(_single, function) if len(results) == 1 else function
        program, _ = lower_or_load(wrapped, *examples, title=part.title)
        functions[called] = lanewise.CFunction(program, arguments, results)
    about = _Meanings(part)
    defaults = {"parameters": jax.tree.leaves(hosted), "inputs": jax.tree.leaves(inputs)}
    library = lanewise.to_c_library(
        functions,
        name,
        mode=MODE,
        values=defaults,
        about=about.comment,
        title=f"{part.title}; {part.statement}",
        extern=("rest", "observe", "derivatives", "complete"),
    )
    variables = tuple(about.variables(library.structs, defaults, functions["advance"]))
    # The step that a host calls: declared before the end of the header, defined behind the functions.
    meanings = ", ".join(json.dumps(meaning) for meaning in MEANINGS.values())
    declared, defined = (with_names(shipped(f"c/step.{kind}"), name, MEANINGS=meanings) for kind in "hc")
    mark = "\n#ifdef __cplusplus\n}\n#endif\n\n#endif\n"
    assert library.header.endswith(mark)
    header, source = library.header.removesuffix(mark) + declared + mark, library.source + defined
    return PartSource(name, part, {f"{name}.h": header, f"{name}.c": source}, variables)


def _single(function: Any, *arguments: Any) -> tuple[Any]:
    return (function(*arguments),)


class _Meanings:
    """What each member of a part's structs is."""

    def __init__(self, part: Part) -> None:
        self.part, self.declared = part, part.declared()
        self.drives = {drive.command: drive for drive in part.hosted.drives}

    def comment(self, group: str, path: str) -> str:
        unit, bounds, meaning = self.of(group, path)
        limits = f", {bounds[0]:g} to {bounds[1]:g}" if np.isfinite(bounds).all() else ""
        return f"{path}{f' [{unit}]' if unit else ''}{limits}{': ' if meaning else ''}{meaning}"

    def of(self, group: str, path: str) -> tuple[str, tuple[float, float], str]:
        free = (-np.inf, np.inf)
        first, _, rest_of = path.partition(".")
        if group == "parameters":
            if path in self.declared:
                stated = self.declared[path]
                low, high = stated.bounds
                return stated.unit, (float(low), float(high)), stated.doc
            start = ("Pa", (-1e5, 1e7), f"gauge pressure of {rest_of} at the start")
            return start if first == "start" else ("", free, "")
        if group == "inputs":
            if first == "command":
                drive = self.drives[rest_of]
                return drive.unit, drive.range if drive.hard else free, drive.meaning
            if first == "rate":
                return "m/s", free, f"rate of the span of {rest_of}"
            meaning = f"span from the anchor to the host's attachment of {rest_of}"
            return "m", self.part.span_limits[rest_of][:2], meaning
        if group == "outputs":
            unit, meaning = UNITS_OF_OUTPUTS[path.rpartition(".")[2] if first == "muscle" else first]
            return unit, free, meaning
        if group == "before" and first == "inputs":
            return self.of("inputs", rest_of)
        if group in ("state", "rates", "before"):
            kind = path.split(".")
            unit, meaning = next((UNITS_OF_STATES[word] for word in kind if word in UNITS_OF_STATES), ("", ""))
            if group == "rates" and unit:
                unit, meaning = per_second(unit), f"rate of the {meaning}"
            return ("s", free, "length of the step") if path == "duration" else (unit, free, meaning)
        return {"period": ("s", free, "step of the host"), "staggered": ("1", free, "1 in a staggered host")}[first]

    def variables(self, structs: Any, defaults: Any, advance: Any) -> Iterator[PartVariable]:
        """All variables, with the values of their defaults, whose places are those of the arguments of `advance`."""
        program, arguments, _ = advance
        for group, members in structs.items():
            known = {}
            if group in defaults:
                begin = f"[{arguments.index(group)}]"
                names = [lanewise.dotted_path(a.name) for a in program.arguments if a.name.startswith(begin)]
                known = {n: np.asarray(v).tolist() for n, v in zip(names, defaults[group], strict=True)}
            for member in members:
                path, (unit, bounds, meaning) = member.path, self.of(group, member.path)
                yield PartVariable(group, member.name, path, unit, bounds, meaning, known.get(path), member.shape)


def per_second(unit: str) -> str:
    """Unit of the rate of a quantity with that unit."""
    return {"m/s": "m/s^2", "1": "1/s"}.get(unit, f"{unit}/s")


def c_ends(bounds: tuple[float, float]) -> tuple[str, str]:
    """Bounds as C writes them, none beyond the largest number."""
    low, high = (repr(float(np.clip(b, -1.7e308, 1.7e308))) for b in bounds)
    return low, high


def shipped(path: str) -> str:
    """The text of a template among the files of this package."""
    return resources.files(__package__).joinpath(path).read_text(encoding="utf-8")


def with_names(text: str, name: str, **words: str) -> str:
    """A text with the name of a part for NAME, the same in capitals for UPPER, and other words."""
    words = {"NAME": name, "UPPER": name.upper(), **words}
    return re.sub("|".join(words), lambda match: words[match[0]], text)
