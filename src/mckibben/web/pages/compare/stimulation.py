"""Stimulation of the biological muscles of a comparison: a protocol with its values, run, drawn and recorded."""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import quote

from ....bench.biological_run import BiologicalSubject, run_biological
from ....errors import InputError
from ....experiments.protocol import Protocol
from ....experiments.read import shipped, stimulation_protocol_names
from ....quantities import with_unit
from ....recordings.recording import Recording
from ....report.recording_report import stimulation_tables
from ....studies.comparison import ComparedMuscle
from ...bench.protocol import changed, form
from ...charts import Axis, Chart, ChartLine
from ...forms import InputField
from ...shelf import plain
from ...transfers import run_in_thread
from ...widgets import box, button, panel, select, table, text
from ...workspace import Workspace

FIRST = "twitch"
LONGEST = 120.0  # that a run of a page may last [s]


def protocols() -> dict[str, str]:
    """Titles of the shipped protocols with stimulation by name, the twitch first."""
    return {name: shipped(name).title for name in (FIRST, *stimulation_protocol_names())}


def stimulated(workspace: Workspace, subject: BiologicalSubject, protocol: Protocol) -> tuple[str, Recording]:
    """Run a protocol on a muscle and keep the recording; return it behind the name of its file."""
    duration = protocol.expand(rest_length=float(subject.muscle.rest_length)).duration
    if duration > LONGEST:
        limit = f"must last at most {with_unit(LONGEST, 's')} on this page; mckibben run has no such limit"
        raise InputError("protocol", with_unit(duration, "s"), limit)
    recording = run_biological(protocol, subject)
    workspace.recordings.ready()
    with workspace.recordings.free(workspace.recordings.numbered(plain(protocol.name), ".nc")) as path:
        recording.save(path)
    return path.name, recording


class StimulationPanel:
    """The panel of a visitor; hidden while no biological muscle is compared."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace, self.protocol = workspace, shipped(FIRST)
        self.muscles: dict[str, ComparedMuscle] = {}
        self.muscle = ""
        with box("div", "stimulation") as self.whole:
            with panel("Stimulation", sub="biological muscles"):
                self.choice = box("div", "stimulation-choice")
                self.values = box("div", "form")
                self.run_button = button("Stimulate", self.run)
                self.result = box("div", "stimulation-result")
        self.whole.set(hidden=True)

    def show(self, muscles: Sequence[ComparedMuscle]) -> None:
        """Offer the biological ones of some muscles."""
        self.muscles = {one.id: one for one in muscles if one.fibre is not None}
        self.whole.set(hidden=None if self.muscles else True)
        if self.muscle not in self.muscles:
            self.muscle = next(iter(self.muscles), "")
        self.choice.clear()
        with self.choice:
            names = {name: one.spec.title for name, one in self.muscles.items()}
            select(names, self.muscle, self._choose_muscle, "Muscle")
            select(protocols(), self.protocol.name, self._choose_protocol, "Protocol")
        self._fields()

    def _choose_muscle(self, name: str) -> None:
        self.muscle = name

    def _choose_protocol(self, name: str) -> None:
        if name not in protocols():
            raise InputError("protocol", name, known=protocols())
        self.protocol = shipped(name)
        self._fields()

    def _fields(self) -> None:
        self.values.clear()
        with self.values:
            for one in form(self.protocol):
                self._field(**{key: str(one[key]) for key in ("name", "label", "value", "unit", "about")})

    def _field(self, name: str, label: str, value: str, unit: str, about: str) -> None:
        def change(words: str) -> None:
            why = ""
            try:
                self.protocol = changed(self.protocol, name, words)
            except InputError as error:
                why = f"{error}. The old value stays in use."
            field.refuse(why)

        field = InputField(label, value, change, unit=unit, hint=about)

    async def run(self) -> None:
        """Run the protocol; show the tension, what was read off, and where the recording is."""
        one, protocol = self.muscles[self.muscle], self.protocol
        assert one.fibre is not None
        subject = BiologicalSubject(one.fibre, one.spec)
        self.run_button.set(disabled=True)
        words = f"{one.id}: {protocol.title[:1].lower()}{protocol.title[1:]}"
        done = await run_in_thread(self.result, words, stimulated, self.workspace, subject, protocol)
        self.run_button.set(disabled=None)
        if done is None:
            return
        with self.result:
            file, record = done
            tension = record["tension"]
            x, across = 1e3 * record.time, Axis("Time", "ms")
            if "Work loops with stimulation" in stimulation_tables(record):
                x, across = 1e2 * record["span"], Axis("Length", "cm", "length")
            title, up = f"{one.spec.title}, {protocol.name}", Axis("Tension", "N", "tension")
            summary = f"Tension of the muscle, up to {with_unit(float(tension.max()), 'N', 3)}"
            Chart(title, summary, across, up, [ChartLine(x, tension, quantity="tension")], height=220).show()
            for listed in stimulation_tables(record).values():
                heads = [f"{c.title}, {c.unit}" if c.unit else str(c.title) for c in listed.columns]
                rows = [[str(cell) for cell in row.cells] for row in listed.rows]
                table(heads, rows, right=range(1, len(heads)), name=protocol.title)
            with box("p", "small"):
                text("span", "Recorded as ")
                text("a", file).set(href=f"/recordings?a={quote(file)}")
        self.workspace.changed()
