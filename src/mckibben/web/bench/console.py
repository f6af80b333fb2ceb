"""The console on the page Bench: the commands of ``mckibben console`` without access to files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...bench.console import COMMANDS, CommandInterpreter, ConsoleCommand, described_dry_run, usage
from ...documents import JsonValue
from ...errors import MckibbenError
from ...experiments.protocol import Protocol
from ...experiments.read import protocol_names

if TYPE_CHECKING:
    from ...bench.rig import Rig
    from ...bench.session.setup import ManualSetup
    from ...specimens import Specimen
    from .machine import Bench

# What a page has not: files are on the page Recordings, time goes by itself. And what it has beside the other commands.
ELSEWHERE = {
    "save": "every run is saved by itself; the page Recordings exports it",
    "record": "every run is saved by itself; for a recording by hand use mckibben console",
    "wait": "time goes by itself here", "quit": "close the page",
}  # fmt: skip
HERE = {name: command for name, command in COMMANDS.items() if name not in ELSEWHERE} | {
    "load": ConsoleCommand("load NAME", "Load a protocol.", "protocol"),
    "run": ConsoleCommand(
        "run [NAME]", "Run the loaded protocol if its dry run passes, or load the named one.", "protocol"
    ),
    "check": ConsoleCommand("check", "Report what the dry run found."),
    "pause": ConsoleCommand("pause", "Let simulated time stand still."),
    "resume": ConsoleCommand("resume", "Go on after a pause."),
    "start": ConsoleCommand("start", "Run the loaded protocol if its dry run passes."),
    "note": ConsoleCommand("note TEXT", "Keep a remark."),
}


class PageConsole(CommandInterpreter):
    """A console that operates the bench of a page.

    Args:
        bench: that it operates.
    """

    def __init__(self, bench: Bench) -> None:
        super().__init__(bench, HERE, ELSEWHERE)
        self.bench = bench

    def answer(self, line: str) -> dict[str, JsonValue]:
        """Execute a line and return the answer; a refusal is an answer, too."""
        try:
            return {"text": self.execute(str(line)[:2000]), "refused": False}
        except MckibbenError as error:
            return {"text": str(error), "refused": True}

    def completions(self, text: str) -> list[str]:
        """List the completions of the last word of a line that a page sent; never a file."""
        return self.complete(str(text)[:400])

    @property
    def protocol(self) -> Protocol:
        """The selected protocol."""
        return self.bench.chosen.protocol

    def use_protocol(self, protocol: Protocol) -> None:
        """Select a protocol, or the selected one with other values."""
        self.bench.actions()["text"](protocol.toml())

    @property
    def setup(self) -> ManualSetup:
        """Limits and rates of manual operation."""
        return self.bench.session.setup

    @property
    def rig(self) -> Rig:
        """The selected rig."""
        return self.bench.chosen.rig

    @property
    def mounted(self) -> Specimen:
        """The selected muscle."""
        return self.bench.chosen.spec

    def dry_run(self) -> str:
        """Describe the dry run of the selected protocol, once it is done."""
        dry = self.bench.chosen.dry
        if dry is None:
            return "the dry run is not done yet"
        return described_dry_run([f["sentence"] for f in dry.plain["findings"]], dry.plain["duration"])

    def protocols(self, start: str) -> list[str]:
        """List the protocols, those of the user too, whose name begins with a text."""
        own = [n.removesuffix(".toml") for n in self.bench.chosen.own.names()]
        return [n for n in [*protocol_names(), *own] if n.startswith(start)]

    def _status(self, words: list[str]) -> str:
        status = self.bench.status()
        said = [f"{status['name'].lower()}: {status['small']}" if status["small"] else status["name"].lower()]
        if status["why"]:
            said.append(str(status["why"]))
        if self.bench.running is None and self.bench.session.ready:
            said += self.bench.session.status().lines()[1:]
        return "\n".join(said)

    def _load(self, words: list[str]) -> str:
        if len(words) != 1:
            raise usage("load", words)
        return str(self.bench.actions()["protocol"](words[0]))

    def _check(self, words: list[str]) -> str:
        return self.dry_run()

    def _run(self, words: list[str]) -> str:
        if words:
            self._load(words)
            return "loaded; run once the dry run has passed"
        return self.bench.start()

    _start = _run

    def _pause(self, words: list[str]) -> str:
        return self.bench.pause()

    def _resume(self, words: list[str]) -> str:
        return self.bench.resume()

    def _note(self, words: list[str]) -> str:
        return self.bench.note(" ".join(words))
