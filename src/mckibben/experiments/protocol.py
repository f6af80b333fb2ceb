"""A protocol: what to do, as an immutable value that prints itself, saves itself, and has one hash for one experiment."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from ..schema import FrozenTable
from .plan import ProtocolPlan, expand
from .sentence import protocol_sentence
from .steps import ProtocolStep, bind
from .waveforms.random import uniform

SCHEMA = 1
ORDERS = ("as listed", "random")


@dataclass(frozen=True)
class ProtocolParameter:
    """A named number or text of a protocol; with several values the steps are run for each of them.

    Values are the words of the file; `inferred` are those that no source prints, and `source` says why they were chosen.
    """

    name: str
    unit: str
    values: tuple[Any, ...]
    about: str = ""
    bounds: tuple[str, ...] = ()
    inferred: tuple[Any, ...] = ()
    note: str = ""

    def table(self) -> dict[str, Any]:
        """Return the parameter as a table of a file."""
        out: dict[str, Any] = {"unit": self.unit}
        if self.values:
            out["value"] = _few(self.values)
        if self.about:
            out["about"] = self.about
        if self.bounds:
            out["low"], out["high"] = self.bounds
        if self.inferred:
            out["inferred"] = list(self.inferred)
        if self.note:
            out["note"] = self.note
        return out


@dataclass(frozen=True)
class ProtocolChoice:
    """A named option that sets parameters, such as ``range = "small"``; several are run one after the other."""

    name: str
    values: tuple[str, ...]
    options: tuple[tuple[str, tuple[tuple[str, Any], ...]], ...]
    about: str = ""
    inferred: tuple[str, ...] = ()
    note: str = ""

    def sets(self, option: str) -> dict[str, Any]:
        """The parameters that an option sets."""
        return dict(dict(self.options)[option])

    def table(self) -> dict[str, Any]:
        """Return the choice as a table of a file."""
        out: dict[str, Any] = {"value": _few(self.values)}
        if self.about:
            out["about"] = self.about
        if self.inferred:
            out["inferred"] = list(self.inferred)
        if self.note:
            out["note"] = self.note
        out["options"] = {option: dict(sets) for option, sets in self.options}
        return out


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """An experiment on a muscle: `first` once, then `steps` for every case and repeat, then `last`.

    A case is one value of every parameter and choice. `needs` are sensors and parts that a rig must have beside those that
    the steps ask for. `sample_rate` [1/s].
    """

    name: str
    title: str
    steps: tuple[FrozenTable, ...]
    first: tuple[FrozenTable, ...] = ()
    last: tuple[FrozenTable, ...] = ()
    parameters: tuple[ProtocolParameter, ...] = ()
    choices: tuple[ProtocolChoice, ...] = ()
    needs: tuple[str, ...] = ()
    sample_rate: float = 1000.0
    order: str = "as listed"
    seed: int = 0
    repeat: int = 1
    source: str = ""
    note: str = ""

    def variables(self) -> dict[str, tuple[Any, ...]]:
        """The values of every choice and parameter by name; those that choices set are empty."""
        return {c.name: c.values for c in self.choices} | {p.name: p.values for p in self.parameters}

    def cases(self) -> list[dict[str, Any]]:
        """Cases in the order in which they are run: the value of each name."""
        varied = {name: values for name, values in self.variables().items() if values}
        listed = [dict(zip(varied, values, strict=True)) for values in itertools.product(*varied.values())]
        cases = [self._with_choices(case) for _ in range(self.repeat) for case in listed]
        if self.order == "random":
            chance = uniform(self.seed, np.arange(len(cases)))
            cases = [cases[i] for i in np.argsort(chance, kind="stable")]
        return cases

    def blocks(self) -> Iterator[tuple[dict[str, Any], list[tuple[str, ProtocolStep]]]]:
        """The case and the steps of each, with their dotted paths: `first`, every case, `last`."""
        cases = self.cases()
        if self.first:
            yield {}, bind(self.first, cases[0], "first")
        for case in cases:
            yield case, bind(self.steps, case, "steps")
        if self.last:
            yield {}, bind(self.last, cases[-1], "last")

    def required(self) -> tuple[str, ...]:
        """Sensors and parts that a rig must have, sorted: those stated and those that steps use."""
        needs = set(self.needs)
        for _, steps in self.blocks():
            for _, step in steps:
                needs |= step.needs()
        return tuple(sorted(needs))

    @property
    def digest(self) -> str:
        """SHA-256 of what is done, however it is written: equal for ``5 bar`` and ``500 kPa``, on every machine."""
        body = [[_plain(s) for _, s in steps] for _, steps in self.blocks()]
        meaning = {"schema": SCHEMA, "rate": _plain(self.sample_rate), "needs": sorted(self.needs), "blocks": body}
        return hashlib.sha256(json.dumps(meaning, sort_keys=True, separators=(",", ":")).encode()).hexdigest()

    def sentence(self) -> str:
        """Describe the whole protocol, with all its numbers."""
        return protocol_sentence(self)

    def document(self) -> dict[str, Any]:
        """Return the protocol as tables of text, which `read.build_protocol` takes and recordings contain."""
        out: dict[str, Any] = {"schema": SCHEMA, "name": self.name, "title": self.title}
        for key in ("source", "note", "order", "seed", "repeat"):
            if getattr(self, key) != type(self).__dataclass_fields__[key].default:
                out[key] = getattr(self, key)
        if self.needs:
            out["needs"] = list(self.needs)
        out["sample_rate"] = f"{self.sample_rate!r} Hz"
        if self.choices:
            out["choices"] = {c.name: c.table() for c in self.choices}
        if self.parameters:
            out["parameters"] = {p.name: p.table() for p in self.parameters}
        for key in ("first", "steps", "last"):
            parts = getattr(self, key)
            if parts:
                out[key] = [part.plain() for part in parts]
        return out

    def toml(self) -> str:
        """Return the protocol as the text of a file."""
        import tomlkit

        return tomlkit.dumps(self.document())

    def expand(self, *, rest_length: float, start_span: float | None = None) -> ProtocolPlan:
        """The flat plan on the sample clock; see `plan.expand`."""
        return expand(self, rest_length=rest_length, start_span=start_span)

    def varied(self) -> tuple[str, ...]:
        """Names of the parameters and choices with more than one value: what tells the cases apart."""
        return tuple(name for name, values in self.variables().items() if len(values) > 1)

    def _with_choices(self, case: Mapping[str, Any]) -> dict[str, Any]:
        full = dict(case)
        for choice in self.choices:
            full |= choice.sets(case[choice.name])
        return full


def _plain(value: Any) -> Any:
    """A value as JSON has it; numbers with 12 digits, so that the way through a unit leaves no trace."""
    if is_dataclass(value) and not isinstance(value, type):
        kind = getattr(value, "kind", "")
        # what only some have, such as lengths in two units, leaves the hash of the others as it was
        named = {f.name: getattr(value, f.name) for f in fields(value) if f.compare}
        named = {k: v for k, v in named.items() if not (k == "mixed" and v is None)}
        return [
            getattr(value, "digest_name", type(value).__name__),
            str(kind),
            {k: _plain(v) for k, v in named.items()},
        ]
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return value
    return f"{float(value) + 0.0:.12g}"


def _few(values: tuple[Any, ...]) -> Any:
    return values[0] if len(values) == 1 else list(values)
