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


class ConsoleCommand(NamedTuple):
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
    "pressure": ConsoleCommand("pressure 3 bar", "Set the pressure of the valve, gauge.", "amount:bar kPa mbar"),
    "span": ConsoleCommand("span 12 cm", "Move the end of the muscle to a span.", "amount:cm mm L0"),
    "velocity": ConsoleCommand("velocity 1 cm/s", "Move the end at a speed; positive lengthens the muscle.", "amount:cm/s L0/s"),
    "tension": ConsoleCommand("tension 20 N", "Hold a tension by the motor.", "amount:N"),
    "vent": ConsoleCommand("vent", "Depressurise at the manual rate; the motor holds its position."),
    "stop": ConsoleCommand("stop [REASON]", "Emergency stop: the valve vents at once and the motor only brakes."),
    "reset": ConsoleCommand("reset", "After a stop: by hand again, vented."),
    "status": ConsoleCommand("status", "Show what the machine does, its measured values and set-points."),
    "load": ConsoleCommand(
        "load NAME|FILE [as CHANNEL]",
        "Load a protocol, or a table of a waveform for the pressure, span, velocity or tension.", "protocol",
    ),
    "set": ConsoleCommand("set NAME=VALUE ..", "Give the loaded protocol other values, several by ', ' or ';'.", "value"),
    "show": ConsoleCommand("show", "Describe the loaded protocol and report what violates the limits here."),
    "run": ConsoleCommand("run [NAME|FILE]", "Run the loaded or the named protocol if its dry run passes.", "protocol"),
    "record": ConsoleCommand("record on [FILE.mcap]|off", "Record manual operation, also into a crash-safe log.", "on|off"),
    "save": ConsoleCommand("save FILE", "Save the last recording in the format of the suffix.", "file:" + " ".join(FORMATS)),
    "list": ConsoleCommand("list protocols|muscles|rigs", "List the known protocols, muscles or rigs.", "|".join(LISTS)),
    "wait": ConsoleCommand("wait 2 s", "Wait for a time on the clock of the machine.", "amount:s ms min"),
    "help": ConsoleCommand("help [COMMAND]", "Explain the commands.", "command"),
    "quit": ConsoleCommand("quit", "Vent and leave."),
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
