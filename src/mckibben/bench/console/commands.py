"""The commands of the console, once: as they are typed, what they do, and what can follow; and how a line becomes words."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from ...errors import InputError
from ...experiments.read import protocol_names

FORMATS = (".nc", ".csv", ".mcap", ".mat", ".parquet", ".tdms")
LISTS = ("protocols", "muscles", "rigs")


class Command(NamedTuple):
    """One of them.

    Attributes:
        usage: as it is typed.
        about: what it does, a sentence.
        follows: what can stand behind it: ``amount:UNITS``, ``file:ENDINGS``, ``protocol``, ``value``, ``command``, or
            words, separated by ``|``.
    """

    usage: str
    about: str
    follows: str = ""


COMMANDS = {
    "pressure": Command("pressure 3 bar", "Set the pressure of the valve, gauge.", "amount:bar kPa mbar"),
    "span": Command("span 12 cm", "Let the motor move the end of the muscle there.", "amount:cm mm L0"),
    "velocity": Command("velocity 1 cm/s", "Let the motor move it on at a speed; positive lengthens.", "amount:cm/s L0/s"),
    "tension": Command("tension 20 N", "Let the motor hold a tension.", "amount:N"),
    "vent": Command("vent", "Let the pressure down; the motor holds where it is."),
    "stop": Command("stop [REASON]", "Emergency stop: the valve vents at once, the motor only brakes."),
    "reset": Command("reset", "After a stop: by hand again, vented."),
    "status": Command("status", "What the machine does, measures and was asked for."),
    "load": Command(
        "load NAME|FILE [as CHANNEL]",
        "Load a protocol, or a table of a waveform for the pressure, span, velocity or tension.", "protocol",
    ),
    "set": Command("set NAME=VALUE ..", "Give the loaded protocol other values, several by ', ' or ';'.", "value"),
    "show": Command("show", "Say what the loaded protocol does, and what speaks against it here."),
    "run": Command("run [NAME|FILE]", "Run the loaded protocol, or another one, if nothing speaks against it.", "protocol"),
    "record": Command("record on [FILE.mcap]|off", "Keep what is done by hand, and write it to a log meanwhile.", "on|off"),
    "save": Command("save FILE", "Save the last recording; its ending says as what.", "file:" + " ".join(FORMATS)),
    "list": Command("list protocols|muscles|rigs", "List what there is.", "|".join(LISTS)),
    "wait": Command("wait 2 s", "Wait for a time of the machine.", "amount:s ms min"),
    "help": Command("help [COMMAND]", "Say what the commands do.", "command"),
    "quit": Command("quit", "Vent, and leave."),
}  # fmt: skip


def complete(text: str, parameters: Iterable[str] = ()) -> list[str]:
    """What the last word of a line can become; `parameters` are those of the loaded protocol."""
    head, _, last = text.rpartition(" ")
    words = head.split()
    if not words:
        return [n for n in COMMANDS if n.startswith(last.lower())]
    command = COMMANDS.get(words[0].lower())
    return [] if command is None else _followers(command.follows, words[1:], last, parameters)


def _followers(follows: str, before: list[str], last: str, parameters: Iterable[str]) -> list[str]:
    kind, _, more = follows.partition(":")
    if kind == "amount":
        return [u for u in more.split() if u.startswith(last)] if len(before) == 1 else []
    if kind == "value":
        return [f"{n}=" for n in parameters if n.startswith(last)]
    if before:
        return []
    if kind == "protocol":
        shipped = [n for n in protocol_names() if n.startswith(last)]
        return shipped + _files(last, (".toml", ".csv", ".mat", ".mcap", ".nc", ".parquet", ".tdms"))
    if kind == "file":
        return _files(last, tuple(more.split()))
    known = list(COMMANDS) if kind == "command" else kind.split("|")
    return [w for w in known if w and w.startswith(last)]


def _files(start: str, endings: tuple[str, ...]) -> list[str]:
    """Files and folders whose path begins so."""
    at = Path(start)
    folder = at if start.endswith("/") or not start else at.parent
    try:
        names = sorted(folder.iterdir())
    except OSError:
        return []
    shown = [f"{p}/" if p.is_dir() else str(p) for p in names if p.is_dir() or p.suffix.lower() in endings]
    return [s for s in shown if s.startswith(start) and not Path(s).name.startswith(".")]


def words_of(line: str) -> list[str]:
    """The words of a line, with quotes as a shell has them; ``#`` begins a comment."""
    reader = shlex.shlex(line, posix=True, punctuation_chars=False)
    reader.whitespace_split, reader.escape, reader.commenters = True, "", ""
    try:
        found = list(reader)
    except ValueError:
        raise InputError("line", line.strip(), "a quotation mark has no other one") from None
    comment = next((i for i, word in enumerate(found) if word.startswith("#")), len(found))
    return found[:comment]


def usage(name: str, words: list[str]) -> InputError:
    """A complaint about what stands behind a command, to be raised."""
    return InputError(name, " ".join(words) or "alone", f"allowed is {COMMANDS[name].usage}")
