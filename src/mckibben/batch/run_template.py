"""Shared parts of all variants of a batch, their settings, and the run of one, as ``mckibben run --set`` would prepare it.

A template holds what it needs of files (rig, specimens, protocol), so that it can be sent to another machine. Settings are
dotted paths as of ``mckibben run --set``, with values as numbers or words:

| path | what it is |
|---|---|
| ``pressure`` | a parameter, choice or setting of the protocol |
| ``rig.plumbing.direct.tube.length`` | a key of the rig's file |
| ``muscle.law.passive_stiffness`` | a declared parameter of the muscle |
| ``muscle``, ``rig``, ``plumbing``, ``noise_seed`` | the specimen, the rig, its way to join the parts, a seed |
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..assembly.build import rig_unit, unit_parameter
from ..assembly.muscle_unit import MuscleUnit
from ..bench.prepare import PreparedRun, prepare
from ..bench.rig import Rig
from ..bench.rig_file import LENGTH, put_rig_value, read_rig
from ..bench.rig_file import rig as rig_of
from ..bench.sensors import SENSORS
from ..components import Environment
from ..documents import JsonValue
from ..engine import STEP
from ..errors import InputError
from ..experiments.amounts import read_amount
from ..experiments.protocol import Protocol
from ..experiments.read import SETTINGS, values_of, with_values
from ..pneumatics.build import ELEMENTS, known_keys
from ..quantities import Quantity, declared, parse, split_values
from ..schema import shown
from ..specimens import Specimen, muscle_specimen
from .outputs import USUAL, Output

WORDS = ("muscle", "rig", "plumbing", "noise_seed")
_ELEMENTS = ("valve", "tube", "shut_off", "leak")
_OF_CHANNEL = ("low", "high", "offset", "noise")  # in the unit of the channel, which the declaration does not know


class Setting(NamedTuple):
    """One path: its SI unit, empty for words, and its declaration if it has one."""

    path: str
    unit: str = ""
    quantity: Quantity | None = None

    def read(self, raw: object, *, where: str | None = None) -> float | str:
        """Read a value of a file: SI, or the text itself (also for lengths in rest lengths).

        Raises:
            InputError: names the path, the value and what is allowed.
        """
        if isinstance(raw, list | tuple):
            return ", ".join(self._text(one, where) for one in raw)
        text = self._text(raw, where)
        if not self.unit:
            return text
        if self.quantity is None:  # of a protocol, whose lengths may be in rest lengths
            values = split_values(text, field=self.path, where=where)
            amounts = [read_amount(v, self.unit, field=self.path, where=where) for v in values or [text]]
            return text if len(amounts) > 1 or amounts[0].unit != self.unit else amounts[0].value
        value = parse(text, self.unit, field=self.path, where=where)
        self.quantity.check(self.path, value, where=where)
        return value

    def text(self, raw: object, *, where: str | None = None) -> str:
        """Format a value of a file, checked as `read` checks it."""
        self.read(raw, where=where)
        return ", ".join(self._text(one, where) for one in (raw if isinstance(raw, list | tuple) else [raw]))

    def _text(self, raw: object, where: str | None) -> str:
        if isinstance(raw, bool):
            return "true" if raw else "false"
        if not isinstance(raw, str | int | float) or raw == "":
            raise InputError(self.path, shown(raw), "must be a number with its unit in words, or a word", where=where)
        return str(raw)

    def words(self, value: JsonValue) -> str:
        """Format a value for ``--set``; it reads back bit for bit."""
        if isinstance(value, str):
            return value
        return repr(float(value)) if self.unit in ("", "1") else f"{float(value)!r} {self.unit}"

    def check(self, low: float, high: float, *, where: str | None = None) -> None:
        """Refuse a range beyond the bounds of the declaration [SI]."""
        for value in (low, high):
            if not math.isfinite(value):
                raise InputError(self.path, value, "must be a finite number", where=where)
            if self.quantity is not None:
                self.quantity.check(self.path, value, where=where)


def setting(path: str, protocol: Protocol, rig: Rig, unit: MuscleUnit, *, where: str | None = None) -> Setting:
    """Find the setting of a dotted path.

    Args:
        path: dotted.
        protocol: that is swept.
        rig: it runs on.
        unit: the muscle.
        where: file, for error messages.

    Raises:
        InputError: names a path that is unknown, with the nearest known ones.
    """
    if path in WORDS:
        return Setting(path)
    if path.startswith("muscle."):
        try:
            quantity = unit_parameter(unit, path.removeprefix("muscle."))
        except InputError as error:
            raise error.changed(value=path, where=where) from None
        return Setting(path, quantity.unit, quantity)
    if path.startswith("rig."):
        of_rig = _of_rig(rig, path.removeprefix("rig."))
        if of_rig is not None:
            return Setting(path, of_rig.unit, of_rig)
        at: Any = rig.document  # a word of the file, or a number of a part that is not known
        for key in path.removeprefix("rig.").split("."):
            at = at.get(key) if isinstance(at, Mapping) else None
        if at is None or isinstance(at, Mapping):
            raise InputError(path, None, f"is not a path of the rig: {_rig_hint(rig, path)}", where=where)
        return Setting(path)
    known = protocol.variables()
    if path not in (*known, *SETTINGS):
        problem = f"other paths begin with rig. or muscle.; {protocol.name} has"
        raise InputError("parameter", path, problem, known=[*known, *SETTINGS], where=where)
    units = {p.name: p.unit for p in protocol.parameters if p.unit != "word"}
    return Setting(path, units.get(path, "1/s" if path == "sample_rate" else ""))


def _of_rig(rig: Rig, path: str) -> Quantity | None:
    """The declaration of a number of the rig's file, None if it is a word or of no known part."""
    table, _, key = path.rpartition(".")
    names = table.split(".")
    if names[0] == "frame" and key in ("shortest", "longest"):
        return LENGTH
    if names[0] == "plumbing" and len(names) == 3 and names[1] in rig.plumbing and names[2] in _ELEMENTS:
        element = getattr(rig.plumbing[names[1]], names[2])
        kind = next((k for k, t in ELEMENTS.items() if t is type(element)), None)
        return None if kind is None else known_keys(kind).get(key)
    owner, unit = _owner(rig, names)
    q = None if owner is None else declared(owner).get(key)
    if q is not None and unit and q.unit == "1" and key in _OF_CHANNEL:
        return q._replace(unit=unit)
    return q


def _owner(rig: Rig, names: list[str]) -> tuple[Any, str]:
    at: Any
    if names[0] == "sensors" and len(names) > 1 and names[1] in rig.sensors:
        at = rig.sensors[names[1]]
        return (at.converter if names[2:] == ["converter"] else at if len(names) == 2 else None), SENSORS[names[1]].unit
    if names[0] == "outputs":
        both = {"valve": (rig.valve_out, "Pa"), "motor": (rig.motor_out, "N")}
        return both.get(".".join(names[1:]), (None, ""))
    if names[0] == "plumbing" and len(names) == 2:
        return rig.plumbing.get(names[1]), ""
    if names[0] == "control" and len(names) == 2:
        return getattr(rig, names[1], None), ""
    if len(names) == 1 and names[0] in ("computer", "encoder", "motor", "frame", "interlocks", "environment"):
        return (Environment if names[0] == "environment" else getattr(rig, names[0])), ""
    return None, ""


def _rig_hint(rig: Rig, path: str) -> str:
    known: list[str] = []

    def below(at: Mapping[str, Any], prefix: str) -> None:
        for key, value in at.items():
            if isinstance(value, Mapping):
                below(value, f"{prefix}{key}.")
            else:
                known.append(f"rig.{prefix}{key}")

    below({k: v for k, v in rig.document.items() if k not in ("inferred", "hands", "schema", "name")}, "")
    import difflib

    some = difflib.get_close_matches(path, known, n=3) or known[:3]
    return f"no such parameter; near are {', '.join(some)}"


KEPT = 32  # rigs and protocols that a process remembers, half a megabyte each


@dataclass(frozen=True, kw_only=True)
class RunTemplate:
    """Everything that is equal in all variants, and the files that any of them needs.

    Attributes:
        protocol: the protocol.
        muscle: the specimen's name, where no variant states another.
        rig: the rig's name, likewise.
        specimens: every muscle that a variant may name.
        rigs: the documents of every rig that a variant may name.
        given: words by path that hold for all variants.
        settings: setting of every varied path.
        outputs: outputs of every variant.
        plumbing: a way to join the rig's parts; by what the protocol needs where empty.
        noise_seed: seed of the sensors' noise.
        step: largest step of the physics [s].
        accept_saturation: go on where only the cell's range would be exceeded.
    """

    protocol: Protocol
    muscle: str
    rig: str = "paper"
    specimens: Mapping[str, Specimen] = field(default_factory=dict)
    rigs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    given: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Setting] = field(default_factory=dict)
    outputs: tuple[Output, ...] = USUAL
    plumbing: str = ""
    noise_seed: int = 0
    step: float = STEP
    accept_saturation: bool = False

    def setting(self, path: str, *, where: str | None = None) -> Setting:
        """Find the setting of a dotted path in the protocol, the first rig or the first muscle."""
        return setting(path, self.protocol, self.first_rig, self.first_unit, where=where)

    @functools.cached_property
    def first_rig(self) -> Rig:
        """Default rig of variants."""
        return read_rig(self.rigs[self.rig], where=_place(self.rig)) if self.rig in self.rigs else rig_of(self.rig)

    @functools.cached_property
    def first_unit(self) -> MuscleUnit:
        """Default muscle of variants."""
        return rig_unit(self.specimens.get(self.muscle) or muscle_specimen(self.muscle))

    def words(self, values: Mapping[str, JsonValue]) -> dict[str, str]:
        """Values of a variant as ``--set`` would state them, including common ones."""
        return {**self.given, **{path: self.settings[path].words(v) for path, v in values.items()}}


class RunFactory:
    """Prepares runs from a template; common parts are reused."""

    def __init__(self, template: RunTemplate) -> None:
        self.template = template
        remembering = functools.lru_cache(maxsize=KEPT)
        self._rig: Callable[[Any], Rig] = remembering(self._read_rig)
        self._protocol: Callable[[Any], Protocol] = remembering(self._read_protocol)
        self._unit: Callable[[str], MuscleUnit] = remembering(lambda name: rig_unit(self._specimen(name)))

    def bench(self, values: Mapping[str, JsonValue]) -> PreparedRun:
        """Prepare the run of one variant of values by path, SI or words, including the dry run.

        Raises:
            InputError: names what is unknown or out of bounds.
        """
        template, settings = self.template, self.template.words(values)
        muscle, rig = settings.pop("muscle", template.muscle), settings.pop("rig", template.rig)
        plumbing = settings.pop("plumbing", template.plumbing) or None
        seed = _whole("noise_seed", settings.pop("noise_seed", template.noise_seed))
        of_rig = {k: v for k, v in settings.items() if k.startswith("rig.")}
        of_muscle = {k: v for k, v in settings.items() if k.startswith("muscle.")}
        of_steps = {k: v for k, v in settings.items() if k not in of_rig and k not in of_muscle}
        return prepare(
            self._protocol(_key(of_steps)),
            muscle=self._specimen(muscle),
            unit=self._unit(muscle),
            changes=of_muscle,
            rig=self._rig((rig, *_key(of_rig))),
            plumbing=plumbing,
            step=template.step,
            seed=seed,
            accept_saturation=template.accept_saturation,
        )

    def _specimen(self, name: str) -> Specimen:
        return self.template.specimens.get(name) or muscle_specimen(name)

    def _read_rig(self, key: tuple[Any, ...]) -> Rig:
        name, *changes = key
        if name not in self.template.rigs:
            return rig_of(name, {k.removeprefix("rig."): v for k, v in changes})
        document = copy.deepcopy(dict(self.template.rigs[name]))
        for path, words in changes:
            put_rig_value(document, path.removeprefix("rig."), words, _place(name))
        return read_rig(document, where=_place(name))

    def _read_protocol(self, key: tuple[Any, ...]) -> Protocol:
        values = {name: values_of(name, words, field=name) for name, words in key}
        return with_values(self.template.protocol, values) if values else self.template.protocol


def make_template(protocol: Protocol, muscle: str, rig: str = "paper", **more: JsonValue) -> RunTemplate:
    """Make a template, and read the files of its muscle and rig.

    Raises:
        InputError: if there is no such muscle or rig, or a path of `given` is unknown.
    """
    made = RunTemplate(
        protocol=protocol,
        muscle=muscle,
        rig=rig,
        specimens={muscle: muscle_specimen(muscle), **more.pop("specimens", {})},
        rigs={rig: dict(rig_of(rig).document), **more.pop("rigs", {})},
        **more,
    )
    for path in made.given:
        made.setting(path)
    return made


def _place(name: str) -> str:
    return name if name.endswith(".toml") else f"{name}.toml"


def _key(words: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    return tuple(sorted(words.items()))


def _whole(field_: str, value: Any) -> int:
    try:
        number = int(str(value))
    except ValueError:
        number = -1
    if number < 0:
        raise InputError(field_, str(value), "must be a whole number, 0 or more")
    return number
