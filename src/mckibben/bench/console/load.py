"""A protocol for the console: a shipped one, a file of one, or a recorded waveform that one channel shall follow."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ...assembly.signal_table import read_points
from ...errors import InputError, suggest
from ...experiments.amounts import CHANNELS
from ...experiments.protocol import Protocol
from ...experiments.read import build_protocol, shipped
from ..software.waveform_import import read_protocol

PROTOCOL = ".toml"


def loaded(name: str, channel: str | None = None) -> Protocol:
    """The protocol that somebody means.

    Args:
        name: of a shipped protocol, or the path of a ``.toml`` file or of a table with a time and one other column.
        channel: what follows the table; by its unit where left out.

    Raises:
        InputError: names what is unknown or cannot be read.
    """
    if channel is not None and channel not in CHANNELS:
        raise InputError("as", channel, f"{suggest(channel, CHANNELS)}known are {', '.join(CHANNELS)}")
    path = Path(name)
    if path.suffix.lower() == PROTOCOL:
        return read_protocol(name)
    if not path.suffix and os.sep not in name:
        return shipped(name)
    if not path.is_file():
        raise InputError("load", name, "no such file")
    return _following(path, *((channel,) if channel else CHANNELS))


def _following(path: Path, *channels: str) -> Protocol:
    """A protocol in which one of some channels, the first whose unit fits, goes as a table says."""
    complaint: InputError | None = None
    for channel in channels:
        unit = CHANNELS[channel]
        try:
            times, values = read_points(path, None, None, unit, field=channel, where=str(path))
        except InputError as error:
            complaint = complaint or error
            continue
        table: dict[str, Any] = {
            "kind": "table", "times": [f"{float(t) - float(times[0])!r} s" for t in times],
            "values": [f"{float(v)!r} {unit}" for v in values],
        }  # fmt: skip
        lasts = f"{float(times[-1]) - float(times[0])!r} s"
        first = {channel: {"to": table["values"][0], "in": "1 s"}, "record": False}
        return build_protocol(
            {
                "schema": 1, "name": path.stem, "title": f"{channel.capitalize()} as in {path.name}",
                "steps": [first, {channel: table, "for": lasts}],
            }, where=str(path),
        )  # fmt: skip
    assert complaint is not None
    raise complaint
