"""The energy flow of a recording: streams whose width is their energy, and a table of the parts.

The account is that of `analysis.energy_accounts`, its streams those of the reports' figure.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....analysis.energy_accounts import CycleEnergy, EnergyAccount, EnergyPart, energy_account
from ....documents import JsonValue
from ....errors import InputError, MckibbenError
from ....quantities import with_unit
from ....recordings import read_recording
from ....report.figures.energy_figures import IN_MUSCLE, LEAST, Streams, energy_flow_figure, streams
from ...elements import Element, page_document
from ...reader import read_outside
from ...shelf import SharedResults
from ...transfers import IncomingFile, UploadPlace, run_in_thread
from ...widgets import box, empty, link, say_refused, select, sentence
from ...workspace import Workspace
from .cycles import EnergyChoice, working_cycle

if TYPE_CHECKING:
    from ....report.figures.page_charts import Figure

_accounts = SharedResults(6)
KINDS = ("simulated", "measured")
SIDES = {"into": "in", "out": "out", "stored": "gained", "remainder": "left"}
WAY = ("valve", "tube", "way_in", "machine")  # lost before the air is in the volumes
ORIGINS = {
    "integral": "the parts are integrated one by one by the run itself, none is found by subtraction",
    "from samples": "the parts are integrated one by one from the samples, none is found by subtraction",
    "estimate": "estimated from pressure, tension and length alone, with the law's volume",
}


def account(path: Path, kind: str = "", muscle: str = "") -> tuple[EnergyAccount, bool]:
    """Account of a recording, and whether the run recorded one.

    Args:
        path: path of the recording.
        kind: ``measured`` for an estimate although the run kept an account.
        muscle: id of the specimen whose law gives the volume, where the recording does not say.

    Raises:
        InputError: it is no recording, or lacks what an account needs; says what.
    """
    if kind and kind not in KINDS:
        raise InputError("account", kind, known=KINDS)

    def make() -> tuple[EnergyAccount, bool]:
        record = read_outside(read_recording, path)
        simulated, measured = bool(record.meta.get("energy")), kind == "measured"
        options: dict[str, Any] = {"muscle": muscle} if muscle and (measured or not simulated) else {}
        return energy_account(record, measured=measured, **options), simulated

    return _accounts.get((path, path.stat().st_mtime_ns, kind, muscle), make)


def stretch(account: EnergyAccount, part: str) -> tuple[EnergyAccount, CycleEnergy | None]:
    """Account of the whole recording (empty text), or of a cycle by its number from 1."""
    if not part:
        return account, None
    if not part.isdigit() or not 1 <= int(part) <= len(account.cycles):
        raise InputError("cycle", part, f"the recording has {len(account.cycles)} of them")
    one = account.cycles[int(part) - 1]
    return replace(account, parts=one.parts), one


def flow_document(account: EnergyAccount, part: str, accumulator: float | None) -> dict[str, JsonValue]:
    """Compute the drawing."""
    one, cycle = stretch(account, part)
    supply = one.value("supply")
    known = math.isfinite(supply)
    gas, muscle = streams(one if known else replace(one, parts=()))
    remainder = 0.0 if abs(one.remainder) < 5e-3 else one.remainder
    said = [f"Remainder {remainder:.2f} J: {ORIGINS.get(one.parts[0].origin, 'summed from samples')}."]
    if not known:
        said = ["The pressure of the supply is not known from this recording, and nothing that is counted against it."]
    if account.unknown:
        said.append(f"Unknown, and not zero: {', '.join(account.unknown)}.")
    said += [sentence(words) for words in (*account.notes, *map(str, account.cautions))]
    if accumulator is not None and accumulator > 0.0 and known and not part:
        saving = account.saved_by_accumulator(accumulator)
        said.append(
            f"An exhaust accumulator at {with_unit(saving.pressure, 'Pa', 3)} would keep at most {saving.exergy:.3g} J, "
            f"{100.0 * saving.share:.3g} % of the supply's."
        )
    air = account.air if cycle is None else cycle.air
    work = one.value("shaft_work")
    return {
        "supply": supply if known else None,
        "efficiency": work / supply if supply > 0.0 else None,
        "least": LEAST,
        "air": 1e3 * air,
        "gas": _plain(gas),
        "muscle": _plain(muscle),
        "hub": IN_MUSCLE,
        "way": WAY,
        "say": said,
        "parts": [_row(p, supply) for p in one.parts if p.value or p.name in ("supply", "shaft_work", "remainder")],
    }


def _row(part: EnergyPart, supply: float) -> dict[str, JsonValue]:
    known = math.isfinite(part.value)
    return {
        "side": SIDES[part.side],
        "name": part.name.replace("_", " "),
        "value": part.value if known else None,
        "share": part.value / supply if known and supply > 0.0 else None,
        "origin": part.origin,
        "meaning": part.meaning,
    }


def _plain(streams: Streams) -> dict[str, JsonValue]:
    return {side: [s._asdict() for s in getattr(streams, side)] for side in ("into", "out")}


LINKED_FLOW = ("recording", "part", "account")
ENDINGS = (".nc", ".csv", ".mcap")
MOST = 200  # recordings in the list
TRIED = 6  # newest ones among which an account is sought
EMPTY = "No recordings yet. Start a run on the bench, or drop a file here."
NO_AIR = "The newest recordings show no use of air. Choose another one, start a run on the bench, or drop a file here."


class RecordedFlow:
    """Energy flow of a recording."""

    def __init__(
        self,
        workspace: Workspace,
        words: Mapping[str, str],
        head: Element,
        bar: Element,
        choice: Callable[[], EnergyChoice],
    ) -> None:
        self.workspace, self.choice = workspace, choice
        self.bar = bar  # which stays, whatever is drawn again
        with head:
            self.head = box("div", "row")
        self.name, self.part, self.kind = (words.get(key, "") for key in LINKED_FLOW)
        self.account: EnergyAccount | None = None
        self.simulated = True
        self.told: float | None = None  # pressure of the accumulator whose saving is shown [Pa]
        self.place = box("div", "e-flow-place")

    def begin(self) -> None:
        """Show the lists, and the recording of the link or the newest one."""
        if self.name:
            page_document().spawn(self._load())
        elif names := self._names():
            page_document().spawn(self._newest(names))
        else:
            self._none()

    def _names(self) -> list[str]:
        return [n for n in self.workspace.recordings.names() if n.lower().endswith(ENDINGS)][:MOST]

    def _none(self) -> None:
        self.place.clear()
        with self.place:
            empty(NO_AIR if self._names() else EMPTY, "To the bench", "/")
            UploadPlace("A recording of mckibben: .nc, .csv or .mcap", self._dropped, ENDINGS)

    async def _newest(self, names: list[str]) -> None:
        """Show the newest recording of which there is an account; those of biological muscles, for one, have no air."""
        for name in names[:TRIED]:
            with contextlib.suppress(MckibbenError):
                await asyncio.to_thread(self._account, name, "")
                self.name = name
                await self._load()
                return
        self._lists()
        self._none()

    async def _dropped(self, one: IncomingFile) -> None:
        path = await asyncio.to_thread(self.workspace.recordings.store, one.name, one.path)
        one.close()
        self.name = path.name
        self.workspace.changed()
        await self._load()

    def _lists(self) -> None:
        self.head.clear()
        names = self._names()
        shown = {n: n for n in ([] if self.name in names or not self.name else [self.name]) + names}
        if not self.name:
            shown = {"": "choose"} | shown
        with self.head:
            if self.account is not None and self.account.cycles:
                cycles = {
                    str(i): f"Cycle {i}, {c.start:.4g} to {c.end:.4g} s" for i, c in enumerate(self.account.cycles, 1)
                }
                select({"": "Whole recording"} | cycles, self.part, self._stretched, "Stretch of the recording")
            if self.account is not None and self.simulated:
                kinds = {"": "As simulated", "measured": "From measured channels"}
                select(kinds, self.kind, lambda kind: self._other(self.name, kind), "Account")
            select(shown, self.name, self._other, "Recording")

    async def _other(self, name: str, kind: str = "") -> None:
        self.name, self.part, self.kind, self.account = name, "", kind, None
        await self._load()

    def _stretched(self, part: str) -> None:
        self.part = part
        self._draw()

    async def _load(self) -> None:
        with self.bar:  # the list that was chosen from is made again
            name, kind = self.name, self.kind
            link(recording=name, account=kind or None, part=self.part or None)
            self._lists()
            result = await run_in_thread(self.place, f"Summing up {name}", self._account, name, kind)
            if result is None or (name, kind) != (self.name, self.kind):
                return
            self.account, self.simulated = result
            self._draw()
            self._lists()

    def _account(self, name: str, kind: str) -> tuple[EnergyAccount, bool]:
        path = self.workspace.recordings.found(name)
        try:
            try:
                return account(path, kind)
            except InputError as error:
                if error.field != "muscle":
                    raise
                return account(path, kind, self.choice().source)  # the page's muscle, where the recording names none
        except (ArithmeticError, LookupError, OSError, RuntimeError, TypeError) as error:  # what others wrote into it
            why = f"{type(error).__name__}: {error}"[:200]
            raise InputError("file", name, f"no account can be made of what is in it ({why})") from None

    def _draw(self) -> None:
        if self.account is None:
            return
        link(part=self.part or None)
        self.told = self._accumulator()
        try:
            document = flow_document(self.account, self.part, self.told)
        except MckibbenError as error:
            say_refused(self.place, error)
            return
        self.place.clear()
        with self.place:
            box("div", "e-flow").data("spec", document)

    def picture(self) -> Figure:
        """Draw the streams of the present account."""
        if self.account is None:
            raise InputError("figure", None, "cannot be saved: no recording is shown")
        return energy_flow_figure(stretch(self.account, self.part)[0])

    def _accumulator(self) -> float | None:
        """Gauge pressure of the accumulator chosen for the cycle [Pa]."""
        choice = self.choice()
        return working_cycle(choice).conditions.exchange_pressure if choice.exchange == "accumulator" else None

    def accumulator_changed(self) -> None:
        """Update the saving after a change of the accumulator."""
        if self.account is not None and self._accumulator() != self.told:
            self._draw()
