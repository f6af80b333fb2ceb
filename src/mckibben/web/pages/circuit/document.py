"""Documents of circuits: the tables of a file, as text, as a link, and examples."""

from __future__ import annotations

import base64
import binascii
import hashlib
import zlib
from collections.abc import Mapping
from typing import Any

from ....assembly.circuit_file import CircuitPlan, build_plan
from ....documents import JsonValue, parse_toml
from ....errors import InputError
from ....quantities import Quantity, from_si, parse, shown_unit

LARGEST = 64 * 1024  # of a file's text [B]
Document = dict[str, Any]
WHERE = "circuit"

_SUPPLY = {"kind": "reservoir", "pressure": "6.9 bar"}
_ROOM = {"kind": "atmosphere"}
_VALVE = {
    "kind": "pressure_regulator", "specimen": "MPP-3-1-8", "supply": "supply", "outlet": "port", "exhaust": "room",
    "flow_into_the_room": "95 l/min", "flow_pressure": "6.9 bar", "dead_time": "2 ms", "command": "pressure",
}  # fmt: skip
_STEP = {"kind": "steps", "times": ["0 s", "20 ms"], "values": ["0 bar", "5 bar"]}
_MUSCLE = {"kind": "muscle", "specimen": "nylon", "length": "14 cm", "dead_volume": "0.5 cm^3"}


def _tube(to: str, length: str) -> Document:
    return {"kind": "lumped_tube", "from": "port", "to": to, "length": length, "diameter": "3.175 mm"}


def starts() -> dict[str, Document]:
    """Example circuits, by title."""
    port = {"kind": "junction", "volume": "2 cm^3"}
    muscle = {
        "schema": 1,
        "title": "Valve, tube, volume and muscle",
        "nodes": {
            "supply": _SUPPLY,
            "room": _ROOM,
            "port": port,
            "volume": {"kind": "volume", "volume": "49.161 cm^3"},
            "muscle": _MUSCLE,
        },
        "elements": {
            "valve": _VALVE,
            "tube": _tube("volume", "100 cm"),
            "fitting": {"kind": "orifice", "from": "volume", "to": "muscle", "hole_diameter": "3.175 mm"},
        },
        "signals": {"pressure": _STEP},
        "run": {"duration": "300 ms"},
    }
    direct = {
        "schema": 1,
        "title": "Valve, tube and muscle",
        "nodes": {"supply": _SUPPLY, "room": _ROOM, "port": port, "muscle": _MUSCLE},
        "elements": {"valve": _VALVE, "tube": _tube("muscle", "50 cm")},
        "signals": {"pressure": _STEP},
        "run": {"duration": "300 ms"},
    }
    tank = {
        "schema": 1,
        "title": "Filling a tank through a tube",
        "nodes": {
            "source": {"kind": "reservoir", "pressure": "5 bar"},
            "tank": {"kind": "volume", "volume": "120 cm^3"},
        },
        "elements": {
            "tube": {"kind": "lumped_tube", "from": "source", "to": "tank", "length": "60 cm", "diameter": "2 mm"}
        },
        "run": {"duration": "1 s"},
    }
    return {str(d["title"]): d for d in (muscle, direct, tank)}


def planned(document: Mapping[str, JsonValue]) -> CircuitPlan:
    """The plan of a document; error messages are those of the command line, without the name of a file.

    Raises:
        InputError: names the dotted path, its value and what is allowed.
    """
    try:
        return build_plan(document, where=WHERE, digest=hashlib.sha256(repr(document).encode()).hexdigest())
    except InputError as error:
        if error.where == WHERE:
            raise error.changed(where="") from None
        raise


def text_of(document: Mapping[str, JsonValue]) -> str:
    """Format a document as the text of a file."""
    import tomlkit

    return tomlkit.dumps(document)


def read_text(text: str) -> Document:
    """Read a document from the text of a file; it must be self-contained, since a page reads no other file.

    Raises:
        InputError: it is too long, no TOML, no circuit, or names a table in another file.
    """
    if len(text.encode()) > LARGEST:
        raise InputError(
            "file", None, f"must be at most {LARGEST >> 10} kB, got {len(text.encode()) >> 10} kB; nothing was stored"
        )
    document = parse_toml(text, where=WHERE)
    signals = document.get("signals", {})
    for name, signal in signals.items() if isinstance(signals, Mapping) else ():
        if isinstance(signal, Mapping) and "file" in _keys(signal):
            raise InputError(
                f"signals.{name}.file",
                None,
                "must be replaced by values in the circuit itself; this page reads no other files",
            )
    _specimens(document)
    planned(document)
    return document


def _keys(value: Any) -> set[str]:
    if isinstance(value, Mapping):
        return set(value) | {k for v in value.values() for k in _keys(v)}
    return {k for v in value for k in _keys(v)} if isinstance(value, list) else set()


def _specimens(document: Mapping[str, JsonValue]) -> None:
    """Check that specimens are named by id, since a path would read another file."""
    for section in ("nodes", "elements"):
        parts = document.get(section, {})
        for name, part in parts.items() if isinstance(parts, Mapping) else ():
            wanted = part.get("specimen", "") if isinstance(part, Mapping) else ""
            if not isinstance(wanted, str) or any(c in wanted for c in "/\\") or wanted.lower().endswith(".toml"):
                raise InputError(
                    f"{section}.{name}.specimen", None, "must be the id of a specimen; this page reads no other files"
                )


def packed(document: Mapping[str, JsonValue]) -> str:
    """Encode a document for a link."""
    squeezed = zlib.compress(text_of(document).encode(), 9)
    return base64.urlsafe_b64encode(squeezed).decode().rstrip("=")


def unpacked(word: str) -> Document:
    """Decode the document of a link.

    Raises:
        InputError: the word was cut or changed, or holds no circuit.
    """
    refusal = InputError("link", None, f"holds no circuit ({word[:12]}..): it was cut or changed on its way")
    try:
        squeezed = base64.urlsafe_b64decode(word[: 2 * LARGEST] + "=" * (-len(word) % 4))
        unpack = zlib.decompressobj()
        data = unpack.decompress(squeezed, LARGEST)
        if unpack.unconsumed_tail:
            raise refusal
        return read_text(data.decode("utf-8"))
    except (ValueError, zlib.error, binascii.Error):
        raise refusal from None


def worded(value: float, quantity: Quantity) -> float | str:
    """Format a value [SI] for a file: in the unit of its field, with enough digits to restore it."""
    if quantity.unit == "1":
        return value
    unit = shown_unit(quantity.unit)
    shown = from_si(value, quantity.unit, unit)
    for digits in (6, 9, 12, 15, 17):
        words = f"{shown:.{digits}g} {unit}"
        if parse(words, quantity.unit, field="value") == value:
            return words
    return f"{value!r} {quantity.unit}"
