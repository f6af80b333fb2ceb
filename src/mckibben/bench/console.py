"""The console of the test machine: interprets commands, one line each, and answers as text.

What it knows stands once, in `COMMANDS`: help, completion and the documentation come from there. It has no
terminal of its own, so that a prompt, a script and a page can each be one: `Console` operates a session, in this process or
another one, and the console of a page the bench of that page.
"""

from __future__ import annotations

import abc
import functools
import os
import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from typing import Protocol as Interface

from ..errors import InputError, not_found, shortened
from ..experiments.amounts import CHANNELS
from ..experiments.dry_run import check
from ..experiments.protocol import Protocol
from ..experiments.read import SETTINGS, build_protocol, protocol_names, read_protocol, shipped, values_of, with_values
from ..quantities import parse, with_unit
from ..recordings import write
from ..recordings.files import read_points
from ..recordings.recording import Recording
from ..specimens import Specimen, specimens
from .protocol_run import Progress
from .rig import Rig
from .rig_file import rig_names
from .session import MachineSession, Status
from .session.interface import ManualSetup

FORMATS = (".nc", ".csv", ".mcap", ".mat", ".parquet", ".tdms")
LISTS = ("protocols", "muscles", "rigs")


class ConsoleCommand(NamedTuple):
    """A command of the console.

    Attributes:
        usage: as it is typed.
        about: description, a sentence.
        follows: what can stand behind it: ``amount:UNITS``, ``file:ENDINGS``, ``protocol``, ``value``, ``command``, or
            words, separated by ``|``.
    """

    usage: str
    about: str
    follows: str = ""


COMMANDS = {
    "pressure": ConsoleCommand("pressure 3 bar", "Set the pressure of the valve, gauge.", "amount:bar kPa mbar"),
    "span": ConsoleCommand("span 12 cm", "Move the end of the muscle to a span.", "amount:cm mm L0"),
    "velocity": ConsoleCommand("velocity 1 cm/s", "Move the end at a speed; positive lengthens.", "amount:cm/s L0/s"),
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


def _files(start: str, endings: tuple[str, ...]) -> list[str]:
    at = Path(start)
    folder = at if start.endswith("/") or not start else at.parent
    try:
        names = sorted(folder.iterdir())
    except OSError:
        return []
    shown = [f"{p}/" if p.is_dir() else str(p) for p in names if p.is_dir() or p.suffix.lower() in endings]
    return [s for s in shown if s.startswith(start) and not Path(s).name.startswith(".")]


def words_of(line: str) -> list[str]:
    """Split a line into words, with the quotes of a shell; ``#`` begins a comment."""
    reader = shlex.shlex(line, posix=True, punctuation_chars=False)
    reader.whitespace_split, reader.escape, reader.commenters = True, "", ""
    try:
        words = list(reader)
    except ValueError:
        raise InputError("line", line.strip(), "a quotation mark has no other one") from None
    comment = next((i for i, word in enumerate(words) if word.startswith("#")), len(words))
    return words[:comment]


def usage(name: str, words: list[str]) -> InputError:
    """Return the error for wrong arguments of a command."""
    right, line = COMMANDS[name].usage, " ".join([name, *words])
    return InputError(name, line, f"must be {right}", sentence=f"Usage: {right}, got {shortened(repr(line))}")


PROTOCOL = ".toml"


def loaded(name: str, channel: str | None = None) -> Protocol:
    """Load a protocol by name, or from a file of a protocol or a waveform.

    Raises:
        InputError: names what is unknown or cannot be read.
    """
    if channel is not None and channel not in CHANNELS:
        raise InputError("as", channel, known=CHANNELS)
    path = Path(name)
    if path.suffix.lower() == PROTOCOL:
        return read_protocol(name)
    if not path.suffix and os.sep not in name:
        return shipped(name)
    if not path.is_file():
        raise not_found(name)
    return _following(path, *((channel,) if channel else CHANNELS))


def _following(path: Path, *channels: str) -> Protocol:
    """Build a protocol that plays a table on the first channel with a matching unit."""
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


LONGEST = 86400.0  # that `wait` waits [s]


class Operated(Interface):
    """What the commands of manual operation act on: a session, or the bench of a page."""

    def set(self, **wanted: float | str) -> str | None:
        """Ask for set-points, as text or SI."""

    def vent(self) -> str | None:
        """Vent at the manual rate."""

    def emergency_stop(self, reason: str) -> str | None:
        """Vent at once."""

    def reset(self) -> str | None:
        """Return to manual mode after a stop."""


class CommandInterpreter(abc.ABC):
    """The commands of a console, whatever they operate.

    Args:
        operated: what set-points and stops act on.
        commands: that are known, by name; each is a method of this name after an underscore.
        elsewhere: commands of another console, by name, and what is done instead.
    """

    def __init__(
        self, operated: Operated, commands: Mapping[str, ConsoleCommand], elsewhere: Mapping[str, str] | None = None
    ) -> None:
        self.operated, self.commands, self.elsewhere = operated, commands, elsewhere or {}

    @property
    @abc.abstractmethod
    def protocol(self) -> Protocol | None:
        """The loaded protocol."""

    @abc.abstractmethod
    def use_protocol(self, protocol: Protocol) -> None:
        """Load a protocol, or the loaded one with other values."""

    @property
    @abc.abstractmethod
    def setup(self) -> ManualSetup:
        """Limits and rates of manual operation."""

    @property
    @abc.abstractmethod
    def rig(self) -> Rig:
        """The rig of the machine."""

    @property
    @abc.abstractmethod
    def mounted(self) -> Specimen | None:
        """The mounted muscle, where it is a specimen."""

    @abc.abstractmethod
    def dry_run(self) -> str:
        """Describe the dry run of the loaded protocol: its violations, or its length."""

    @abc.abstractmethod
    def protocols(self, start: str) -> list[str]:
        """List what begins with a text and can be loaded."""

    def execute(self, line: str) -> str:
        """Execute a line and return the answer; an empty line or a comment has none.

        Raises:
            InputError: one clear line; the console stays as it is.
            MckibbenError: an error of the command, such as a lost machine.
        """
        words = words_of(line)
        if not words:
            return ""
        name, rest = words[0].lower(), words[1:]
        if name in self.elsewhere:
            raise InputError("command", name, self.elsewhere[name])
        if name not in self.commands:
            raise InputError("command", words[0], known=self.commands)
        answer: str | None = getattr(self, f"_{name}")(rest)
        return answer or ""

    def complete(self, text: str) -> list[str]:
        """List the completions of the last word of a line."""
        head, _, last = text.rpartition(" ")
        words = head.split()
        if not words:
            return [n for n in self.commands if n.startswith(last.lower())]
        command = self.commands.get(words[0].lower())
        return [] if command is None else self._followers(command.follows, words[1:], last)

    def _followers(self, follows: str, before: list[str], last: str) -> list[str]:
        kind, _, more = follows.partition(":")
        if kind == "amount":
            return [u for u in more.split() if u.startswith(last)] if len(before) == 1 else []
        if kind == "value":
            names = [] if self.protocol is None else [*self.protocol.variables(), *SETTINGS]
            return [f"{n}=" for n in names if n.startswith(last)]
        if before:
            return []
        if kind == "protocol":
            return self.protocols(last)
        if kind == "file":
            return _files(last, tuple(more.split()))
        known = list(self.commands) if kind == "command" else kind.split("|")
        return [w for w in known if w and w.startswith(last)]

    def _amount(self, name: str, words: list[str]) -> str:
        self.operated.set(**{name: _some(name, words)})
        manual = self.setup.manual
        rates = {
            "pressure": (manual.pressure_rate, "Pa", "/s"), "span": (manual.speed, "m/s", ""),
            "velocity": (manual.acceleration, "m/s^2", ""), "tension": (manual.tension_rate, "N", "/s"),
        }  # fmt: skip
        rate, unit, per = rates[name]
        return f"{name} to {' '.join(words)}, at {with_unit(float(rate), unit, 3)}{per} at most"

    _pressure, _span = functools.partialmethod(_amount, "pressure"), functools.partialmethod(_amount, "span")
    _velocity, _tension = functools.partialmethod(_amount, "velocity"), functools.partialmethod(_amount, "tension")

    def _vent(self, words: list[str]) -> str | None:
        _none("vent", words)
        return self.operated.vent()

    def _stop(self, words: list[str]) -> str | None:
        return self.operated.emergency_stop(" ".join(words) or "from the console")

    def _reset(self, words: list[str]) -> str | None:
        _none("reset", words)
        return self.operated.reset()

    def _set(self, words: list[str]) -> str:
        protocol = self.chosen()
        changes: dict[str, str] = {}
        for word in words:
            name, equals, value = word.partition("=")
            if equals:
                changes[name] = value
            elif changes:  # what belongs to the value before, such as a unit
                last = next(reversed(changes))
                changes[last] = f"{changes[last]} {word}".strip()
            else:
                raise usage("set", words)
        if not changes or not all(v.strip() for v in changes.values()):
            raise usage("set", words)
        changed = with_values(protocol, {name: values_of(name, v, field=name) for name, v in changes.items()})
        self.use_protocol(changed)
        values = changed.variables().items()
        return ", ".join(f"{n} {', '.join(map(str, v))}" for n, v in values if v) or changed.title

    def _show(self, words: list[str]) -> str:
        _none("show", words)
        return f"{self.chosen().sentence()}\n{self.dry_run()}"

    def _list(self, words: list[str]) -> str:
        if len(words) != 1 or words[0] not in LISTS:
            raise usage("list", words)
        if words[0] == "protocols":
            return _columns([(n, shipped(n).title) for n in protocol_names()])
        if words[0] == "rigs":
            return _columns([(n, "here" if n == self.rig.name else "") for n in rig_names()])
        known = [s for s in specimens() if s.kind != "valve"]
        mounted = None if self.mounted is None else self.mounted.id
        return _columns([(s.id, f"{s.title}{' (mounted)' if s.id == mounted else ''}") for s in known])

    def _help(self, words: list[str]) -> str:
        if not words:
            return _columns([(c.usage, c.about) for c in self.commands.values()])
        if len(words) != 1 or words[0] not in self.commands:
            raise InputError("help", " ".join(words), known=self.commands)
        command = self.commands[words[0]]
        return f"{command.usage}\n{command.about}"

    def chosen(self) -> Protocol:
        """Return the loaded protocol.

        Raises:
            InputError: if there is none.
        """
        if self.protocol is None:
            raise InputError("protocol", None, f"must be loaded first: {', '.join(protocol_names())}")
        return self.protocol


class Console(CommandInterpreter):
    """A console that operates a session by lines of text.

    Args:
        session: the machine, in this process or another one.
        ask: told what a person has to do during a protocol; returns when it is done.
        progress: told how far a run is.

    Attributes:
        over: whether the user left by `quit`.
        recording: the last one.
    """

    def __init__(
        self, session: MachineSession, *, ask: Callable[[str], None] | None = None, progress: Progress | None = None
    ) -> None:
        super().__init__(session, COMMANDS)
        self.session, self.ask, self.progress = session, ask, progress
        self.over = False
        self.recording: Recording | None = None
        self._protocol: Protocol | None = None
        self._heard = 0

    @property
    def protocol(self) -> Protocol | None:
        """The loaded protocol."""
        return self._protocol

    def use_protocol(self, protocol: Protocol) -> None:
        """Load a protocol, or the loaded one with other values."""
        self._protocol = protocol

    @property
    def setup(self) -> ManualSetup:
        """Limits and rates of manual operation."""
        return self.session.setup

    @property
    def rig(self) -> Rig:
        """The rig of the machine."""
        return self.session.rig

    @property
    def mounted(self) -> Specimen | None:
        """The mounted muscle, where it is a specimen."""
        return self.session.setup.prepared.specimen

    def dry_run(self) -> str:
        """Describe the dry run of the loaded protocol on this machine."""
        bench = self.session.prepare(self.chosen())
        return described_dry_run([f.sentence for f in bench.findings], bench.plan.duration)

    def protocols(self, start: str) -> list[str]:
        """List the protocols and files whose name begins with a text."""
        names = [n for n in protocol_names() if n.startswith(start)]
        return names + _files(start, (".toml", ".csv", ".mat", ".mcap", ".nc", ".parquet", ".tdms"))

    def news(self) -> list[str]:
        """Return the messages of the machine since the last call."""
        messages = self.session.messages(self._heard)
        self._heard = messages[-1].number if messages else self._heard
        return [m.text if m.time is None else f"[{m.time:9.3f} s] {m.text}" for m in messages]

    def status(self) -> Status:
        """Return the status of the machine."""
        return self.session.status()

    def _status(self, words: list[str]) -> str:
        _none("status", words)
        return "\n".join(self.status().lines())

    def _load(self, words: list[str]) -> str:
        name, channel = _some("load", words[:1]), None
        if words[1:]:
            if len(words) != 3 or words[1] != "as":
                raise usage("load", words)
            channel = words[2]
        self._protocol = loaded(name, channel)
        return f"{self._protocol.name}: {self._protocol.title}"

    def _run(self, words: list[str]) -> str:
        if words:
            self._load(words)
        bench = self.session.prepare(self.chosen())
        check(list(bench.findings))
        self.recording = self.session.run(bench, progress=self.progress, ask=self.ask)
        return _told(self.recording)

    def _record(self, words: list[str]) -> str:
        if words[:1] == ["on"] and len(words) <= 2:
            self.session.start_recording(log=words[1] if words[1:] else None)
            return ""
        if words != ["off"]:
            raise usage("record", words)
        self.recording = self.session.stop_recording()
        return _told(self.recording)

    def _save(self, words: list[str]) -> str:
        path = Path(" ".join(_some("save", words).split()))
        if path.suffix.lower() not in FORMATS:
            raise InputError("save", str(path), f"must be a name that ends in {', '.join(FORMATS)}")
        if not path.absolute().parent.is_dir():
            raise not_found(path.absolute().parent, "folder")
        if self.recording is None:
            raise InputError("save", str(path), "there is no recording yet; use it after a run or record off")
        return "\n".join([f"Written: {path}", *write(self.recording, path)])

    def _wait(self, words: list[str]) -> str:
        text = _some("wait", words)
        seconds = parse(text, "s", field="wait")
        if not 0.0 <= seconds <= LONGEST:
            raise InputError("wait", text, f"must be between 0 s and {LONGEST:g} s")
        self.session.wait(seconds)
        return self.status().line()

    def _quit(self, words: list[str]) -> str:
        _none("quit", words)
        self.over = True
        return ""


def described_dry_run(findings: list[str], duration: float) -> str:
    """Describe the result of a dry run: its violations, or that it passes and how long the run lasts at most [s]."""
    return "\n".join(findings) or f"At most {duration:.4g} s; the dry run passes."


def _some(name: str, words: list[str]) -> str:
    if not words:
        raise usage(name, words)
    return " ".join(words)


def _none(name: str, words: list[str]) -> None:
    if words:
        raise usage(name, words)


def _columns(rows: list[tuple[str, str]]) -> str:
    width = max(len(first) for first, _ in rows)
    return "\n".join(f"{first:<{width}}  {second}".rstrip() for first, second in rows)


def _told(recording: Recording) -> str:
    rows = [("", f"{'lowest':>12}{'mean':>12}{'highest':>12}")]
    for name, one in recording.summary().items():
        if one["kind"] == "measured":
            rows.append((name, "".join(f"{with_unit(one[k], one['unit']):>12}" for k in ("min", "mean", "max"))))
    return f"{len(recording)} samples, {recording.duration:.4g} s\n{_columns(rows)}"
