"""``muscles`` and ``protocols``: lists of what ships with the package, and descriptions of experiments with all numbers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..citations import known_keys, reference
from ..documents import JsonValue, write_text
from ..errors import InputError
from ..experiments import amounts
from ..experiments import read as reading
from ..experiments.protocol import is_inferred
from ..specimens import specimens
from ._outputs import OBJECT, SPECIMEN, TABLE, OutputKinds, Paths
from ._terminal import Json, pairs, print_json, table

if TYPE_CHECKING:
    from ..experiments.protocol import Protocol, ProtocolChoice, ProtocolParameter


REST_LENGTH = 0.14  # of the muscle for which a duration is stated [m]
LIST = OutputKinds(table=TABLE, result=OBJECT)
OUT = OutputKinds(protocol=SPECIMEN, result=OBJECT)
_EXAMPLE = "pressure='1 bar, 3 bar'"

Name = Annotated[
    str | None,
    typer.Argument(metavar="PROTOCOL", help="Name of a shipped protocol, or a .toml file; without it all are listed."),
]
Values = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help=f"Change a parameter; several values separated by ', ' or ';', such as {_EXAMPLE}.",
    ),
]


def list_muscles(out: Annotated[Paths, LIST.option()] = None, as_json: Json = False) -> None:
    """List the muscles that ship, with their sources.

    $ mckibben muscles --out muscles.csv
    """
    with LIST.files(out) as files:
        known = [s for s in specimens() if s.kind != "valve"]
        listed = [{"id": s.id, "source": s.source(), "law": s.law, "inferred": s.inferred()} for s in known]
        files.write_rows([row | {"title": s.title} for row, s in zip(listed, known, strict=True)])
        files.write_result({"specimens": listed})
        if as_json:
            print_json({"specimens": listed})
            return
        rows = [[s.id, s.title, s.law, s.source(), str(len(s.inferred()))] for s in known]
        table("Muscles", ["id", "what it is", "law", "source", "inferred numbers"], rows, right=[4])
        files.say()


def protocols(
    name: Name = None,
    change: Values = None,
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """List the protocols, or describe one of them with all its numbers.

    $ mckibben protocols work-loop --set cycles=3 --out my.toml
    """
    if name is None:
        for option, value in (("--set", change), ("--out", out)):
            if value:
                raise InputError(option, None, "is allowed only after the name of one")
        _list(as_json)
        return
    with OUT.files(out) as files:
        chosen = chosen_protocol(name, change)
        text = _text(name, chosen, change)
        files.write("protocol", lambda path: write_text(path, text.rstrip("\n") + "\n"))
        if files["result"]:
            files.write_result(_described(chosen, text))
        if as_json:
            print_json(_described(chosen, text))
        else:
            _print(chosen)
            files.say()


def chosen_protocol(name: str, change: list[str] | None = None) -> Protocol:
    """Load a shipped protocol or that of a ``.toml`` file, with the values of ``--set``.

    Raises:
        InputError: names what is unknown, out of bounds or in the wrong unit.
    """
    protocol = reading.read_protocol(name) if name.endswith(".toml") else reading.shipped(name)
    values = {
        key: reading.values_of(key, words, field=f"--set {key}")
        for key, words in pairs(change, "--set", _EXAMPLE).items()
    }
    if not values:
        return protocol
    try:
        return reading.with_values(protocol, values)
    except InputError as error:
        # a parameter is called as it was typed; the path of a step that it spoils is not
        field = f"--set {error.field}" if error.field in values else error.field
        raise error.changed(field=field) from None


def _list(as_json: bool) -> None:

    known = [reading.shipped(name) for name in reading.protocol_names()]
    stimulated = [reading.shipped(name) for name in reading.stimulation_protocol_names()]
    if as_json:
        rows = [{"name": p.name, "title": p.title, "source": p.source} for p in (*known, *stimulated)]
        print_json({"protocols": rows})
        return
    table("Protocols", ["name", "what is done", "source"], [[p.name, p.title, p.source] for p in known])
    typer.echo("")
    rows_of = [[p.name, p.title, p.source] for p in stimulated]
    table("Protocols with stimulation, of biological muscles", ["name", "what is done", "source"], rows_of)


def _text(name: str, protocol: Protocol, change: list[str] | None) -> str:
    """Text of the file; with values changed, that of the changed protocol."""
    if change:
        return protocol.toml()
    if name.endswith(".toml"):
        return Path(name).read_text(encoding="utf-8")
    return reading.shipped_text(name)


def _described(protocol: Protocol, text: str) -> dict[str, JsonValue]:

    key = protocol.source.split(",")[0]
    return {
        "name": protocol.name,
        "title": protocol.title,
        "source": protocol.source,
        "reference": reference(key) if key in known_keys() else None,
        "note": protocol.note,
        "sentence": protocol.sentence(),
        "choices": {c.name: _choice(c) for c in protocol.choices},
        "parameters": {p.name: _parameter(protocol, p) for p in protocol.parameters},
        "varied": list(protocol.varied()),
        "needs": list(protocol.required()),
        "sample_rate": protocol.sample_rate,
        "order": protocol.order,
        "seed": protocol.seed,
        "repeat": protocol.repeat,
        "duration": _duration(protocol),
        "hash": protocol.digest,
        "document": protocol.document(),
        "toml": text,
    }


def _choice(choice: ProtocolChoice) -> dict[str, JsonValue]:
    return {
        "values": list(choice.values),
        "inferred": [v for v in choice.values if v in choice.inferred],
        "options": {option: dict(sets) for option, sets in choice.options},
        "about": choice.about,
        "note": choice.note,
    }


def _parameter(protocol: Protocol, p: ProtocolParameter) -> dict[str, JsonValue]:

    def entry(value: Any) -> dict[str, JsonValue]:
        if p.unit == "word":
            return {"value": value, "unit": "word", "words": value, "inferred": is_inferred(p, value)}
        amount = amounts.read_amount(value, p.unit, field=p.name)
        words = {"value": amount.value, "unit": amount.unit, "words": str(value)}
        return words | {"inferred": is_inferred(p, value) or _by_inferred(protocol, p, value)}

    return {
        "unit": p.unit,
        "values": [entry(v) for v in _values(protocol, p)],
        "bounds": [entry(b) | {"inferred": False} for b in p.bounds] or None,
        "set_by": None if p.values else _setter(protocol, p),
        "about": p.about,
        "note": p.note,
    }


def _values(protocol: Protocol, p: ProtocolParameter) -> list[Any]:
    """Values of a parameter: its own, or those that a choice assigns to it."""
    return list(p.values or dict.fromkeys(case[p.name] for case in protocol.cases()))


def _setter(protocol: Protocol, p: ProtocolParameter) -> str:
    return next(c.name for c in protocol.choices if any(p.name in dict(sets) for _, sets in c.options))


def _by_inferred(protocol: Protocol, p: ProtocolParameter, value: Any) -> bool:
    """Whether the entry depends on an option of a choice that no source prints."""
    return not p.values and any(
        c.sets(o).get(p.name) == value for c in protocol.choices for o in c.values if o in c.inferred
    )


def _duration(protocol: Protocol) -> dict[str, JsonValue]:
    """Longest time [s] for a typical muscle; None if it is unknown in advance."""
    about: dict[str, Any] = {"rest_length": REST_LENGTH}
    try:
        plan = protocol.expand(rest_length=REST_LENGTH)
    except InputError as error:
        return about | {"longest": None, "samples": None, "steps": None, "note": str(error)}
    until = any(step.until is not None for step in plan.steps)
    note = "the longest: steps may end earlier" if until else ""
    return about | {"longest": plan.duration, "samples": plan.samples, "steps": len(plan.steps), "note": note}


def _print(protocol: Protocol) -> None:
    description = _described(protocol, "")
    typer.echo(description["sentence"])
    rows = []
    for name, c in description["choices"].items():
        values = [f"{v} (inferred)" if v in c["inferred"] else v for v in c["values"]]
        rows.append([name, ", ".join(values), f"one of {', '.join(c['options'])}", _said(c)])
    for name, p in description["parameters"].items():
        values = [f"{v['words']} (inferred)" if v["inferred"] else str(v["words"]) for v in p["values"]]
        # a bound is stated, a unit shows what else is allowed
        allowed = " to ".join(b["words"] for b in p["bounds"]) if p["bounds"] else _kind(p["unit"])
        rows.append([name, ", ".join(values), allowed, _said(p)])
    if rows:
        typer.echo("")
        table("", ["parameter", "value", "allowed", ""], rows)
    lines = [f"Needs: {', '.join(description['needs'])}."]
    length = description["duration"]
    if length["longest"] is None:
        lines.append(f"Duration not known in advance: {length['note']}.")
    else:
        at_most, count = "at most " if length["note"] else "", length["steps"]
        lines.append(
            f"Duration: {at_most}{_time(length['longest'])} in {count} step{'' if count == 1 else 's'}, "
            f"for a rest length of {100 * REST_LENGTH:g} cm."
        )
    if description["note"]:
        lines.append(f"Note: {description['note'].rstrip('.')}.")
    if description["source"]:
        lines.append(
            f"Source: {description['source']}." + (f" {description['reference']}" if description["reference"] else "")
        )
    lines.append(f"Hash: {description['hash']}")
    typer.echo("\n" + "\n".join(lines))


def _said(entry: dict[str, Any]) -> str:
    by = f"set by {entry['set_by']}" if entry.get("set_by") else ""
    return "; ".join(w for w in (by, entry["about"], entry["note"]) if w)


def _kind(unit: str) -> str:
    words = {"m": "a length, or in L0", "m/s": "a velocity, or in L0/s", "1": "a number", "word": "a word"}
    return words.get(unit, f"a value in {unit}")


def _time(seconds: float) -> str:
    minutes, rest = divmod(seconds, 60.0)
    return f"{minutes:.0f} min {rest:.3g} s" if minutes else f"{rest:.4g} s"
