"""The console on the page Bench: the commands of ``mckibben console`` without access to files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...bench.console import COMMANDS, Console, words_of
from ...errors import InputError, MckibbenError, suggest
from ...experiments.read import protocol_names

if TYPE_CHECKING:
    from ...bench.rig import Rig
    from ...specimens import Specimen
    from .machine import Bench

# What a page has beside them, and what it has not: files are on the page Recordings, time goes by itself.
MORE = {
    "check": "check: repeat the dry run and report its violations.",
    "pause": "pause: let simulated time stand still.", "resume": "resume: go on.", "start": "start: as run.",
    "note": "note TEXT: keep a remark.",
}  # fmt: skip
NOT_HERE = {
    "save": "every run is saved by itself; the page Recordings exports it",
    "record": "every run is saved by itself; for a recording by hand use mckibben console",
    "wait": "time goes by itself here", "quit": "close the page",
}  # fmt: skip


class PageConsole(Console):
    """A console that operates the bench of a page.

    Args:
        bench: that it operates.
    """

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        super().__init__(None)  # type: ignore[arg-type]  # the session comes and goes with the muscle

    def answer(self, line: str) -> dict[str, Any]:
        """Execute a line and return the answer; a refusal is an answer, too."""
        try:
            return {"text": self._do(str(line)[:2000]), "refused": False}
        except MckibbenError as error:
            return {"text": str(error), "refused": True}

    def _do(self, line: str) -> str:
        words = words_of(line)
        if not words:
            return ""
        name, rest = words[0].lower(), words[1:]
        if name in NOT_HERE:
            raise InputError("command", name, NOT_HERE[name])
        if name not in COMMANDS and name not in MORE:
            known = [*(c for c in COMMANDS if c not in NOT_HERE), *MORE]
            raise InputError("command", words[0], f"{suggest(name, known)}known are {', '.join(known)}")
        found = getattr(self, f"_{name}")(rest)
        return str(found)

    def complete(self, text: str) -> list[str]:
        """List the completions of the last word of a line; never a file."""
        head, _, last = str(text)[:400].rpartition(" ")
        first = head.split()[:1]
        if not first:
            return [n for n in [*COMMANDS, *MORE] if n not in NOT_HERE and n.startswith(last.lower())]
        if first[0] in ("load", "run"):
            mine = [n.removesuffix(".toml") for n in self.bench.chosen.own.names()]
            return [n for n in [*protocol_names(), *mine] if n.startswith(last)]
        self.protocol = self.bench.chosen.protocol
        return super().complete(text)

    def _amount(self, name: str, words: list[str]) -> str:
        if not words:
            raise InputError(name, "alone", f"allowed is {COMMANDS[name].usage}")
        self.bench.set(**{name: " ".join(words)})
        return f"{name} to {' '.join(words)}"

    def _vent(self, words: list[str]) -> str:
        return self.bench.vent()

    def _stop(self, words: list[str]) -> str:
        self.bench.emergency_stop(" ".join(words) or "from the console")
        return "vented"

    def _reset(self, words: list[str]) -> str:
        return self.bench.reset()

    def _status(self, words: list[str]) -> str:
        status = self.bench.status()
        said = [f"{status['name'].lower()}: {status['small']}" if status["small"] else status["name"].lower()]
        if status["why"]:
            said.append(str(status["why"]))
        session = None if self.bench.manual is None else self.bench.manual.session
        if session is not None and self.bench.running is None:
            said += session.status().lines()[1:]
        return "\n".join(said)

    def _load(self, words: list[str]) -> str:
        if len(words) != 1:
            raise InputError("load", " ".join(words) or "alone", "allowed is load NAME, of a protocol")
        return self.bench.actions()["protocol"](words[0])

    def _set(self, words: list[str]) -> str:
        self.protocol = self.bench.chosen.protocol
        said = super()._set(words)
        protocol = self.protocol
        self.bench.actions()["text"](protocol.toml())
        return said

    def _show(self, words: list[str]) -> str:
        return f"{self.bench.chosen.protocol.sentence()}\n{self._found()}"

    def _found(self) -> str:
        dry = self.bench.chosen.dry
        if dry is None:
            return "the dry run is not done yet"
        found = [f["sentence"] for f in dry.plain["findings"]]
        return "\n".join(found) or f"At most {dry.plain['duration']:.4g} s; the dry run passes."

    def _check(self, words: list[str]) -> str:
        return self._found()

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

    def _here(self) -> Rig:
        return self.bench.chosen.rig

    def _mounted(self) -> Specimen:
        return self.bench.chosen.spec

    def _help(self, words: list[str]) -> str:
        if words and words[0] in MORE:
            return MORE[words[0]]
        if words:
            return super()._help(words)
        here = [f"{c.usage:<34}{c.about}" for n, c in COMMANDS.items() if n not in NOT_HERE]
        return "\n".join([*here, *MORE.values()])
