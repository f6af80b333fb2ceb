"""Shared parts of all variants of a batch, and the run of one variant, as ``mckibben run --set`` would prepare it.

A template holds what it needs of files (rig, specimens, protocol), so that it can be sent to another machine.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..assembly.build import rig_unit
from ..assembly.muscle_unit import MuscleUnit
from ..bench.prepare import PreparedRun, prepare
from ..bench.rig import Rig
from ..bench.rig_file import put_rig_value, read_rig
from ..bench.rig_file import rig as rig_of
from ..components import paths
from ..documents import JsonValue
from ..engine import STEP
from ..errors import InputError
from ..experiments.protocol import Protocol
from ..experiments.read import values_of, with_values
from ..quantities import parse
from ..specimens import Specimen, muscle_specimen
from .outputs import USUAL, Output
from .settings import Setting, setting

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
        self._rig = _remembering(self._read_rig)
        self._protocol = _remembering(self._read_protocol)
        self._unit = _remembering(lambda name: rig_unit(self._specimen(name)))

    def bench(self, values: Mapping[str, JsonValue]) -> PreparedRun:
        """Prepare the run of one variant, including the dry run.

        Args:
            values: by path, SI or words.

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
            unit=self._changed(self._unit(muscle), of_muscle),
            rig=self._rig((rig, *_key(of_rig))),
            plumbing=plumbing,
            step=template.step,
            seed=seed,
            accept_saturation=template.accept_saturation,
        )

    def _specimen(self, name: str) -> Specimen:
        return self.template.specimens.get(name) or muscle_specimen(name)

    @staticmethod
    def _changed(unit: MuscleUnit, given: Mapping[str, str]) -> MuscleUnit:
        for key, words in given.items():
            path = key.removeprefix("muscle.")
            declared = paths.declaration(unit, path)
            value = parse(words, declared.unit, field=key)
            declared.check(key, value)
            unit = paths.put(unit, {path: value})
        return unit

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


def _remembering(make: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return functools.lru_cache(maxsize=KEPT)(make)


def _whole(field_: str, value: Any) -> int:
    try:
        number = int(str(value))
    except ValueError:
        number = -1
    if number < 0:
        raise InputError(field_, str(value), "must be a whole number, 0 or more")
    return number
