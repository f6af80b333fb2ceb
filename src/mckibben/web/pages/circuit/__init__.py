"""The Circuit page: valve, tube, volume and muscle from parts, with diagram and step response."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ....documents import parse_toml
from ....errors import InputError, MckibbenError
from ....pneumatics.circuit import RunBalance
from ....quantities import parse, with_unit
from ....report.figures import circuit_diagram
from ... import charts
from ...charts import saveable
from ...elements import call_script, page_document
from ...forms import show_cautions
from ...shelf import Shelf
from ...transfers import IncomingFile, UploadPlace, download
from ...widgets import Dialog, asked, box, button, link, loading, page_frame, panel, raw, say_refused, tell, text
from ...workspace import Workspace
from . import diagram, inspector, response
from . import document as circuits
from .diagram import flow_chart, numbers, palette, pressure_chart, sweep_chart
from .document import LARGEST, Document, muscle_of, read_text, rig_text, starts, text_of, unpacked
from .state import CircuitAnswer, CircuitState, follow

if TYPE_CHECKING:
    from starlette.requests import Request


def build(workspace: Workspace, request: Request) -> None:
    """Build the page."""
    shelf = Shelf(workspace.recordings.folder / "circuits", (".toml",))
    view = asked(request, "part", "sensors", "flows", "models", "file")
    circuit, said, word = next(iter(starts().values())), "", request.query_params.get("c", "")
    try:
        if word:
            circuit = unpacked(word)
        elif "file" in view:
            circuit = read_text(shelf.found(f"{view['file']}.toml").read_text(encoding="utf-8"))
    except InputError as error:
        said = str(error)
    CircuitPage(workspace, shelf, circuit, view).build(said)


TICK = (
    '<svg width="11" height="10" aria-hidden="true"><path d="M1 5l3 3 6-7" fill="none" stroke="currentColor" '
    'stroke-width="1.8"/></svg>'
)


class CircuitPage:
    """The Circuit page of one visitor."""

    def __init__(self, workspace: Workspace, shelf: Shelf, document: Document, view: dict[str, str]) -> None:
        self.workspace, self.shelf = workspace, shelf
        self.desk = CircuitState(document, view.get("part", ""))
        self.heads: object = None  # on what the shown inputs depend
        named = {k: [w for w in view[k].split(",") if w] for k in ("sensors", "flows", "models") if k in view}
        self.desk.sensors = response.shown_nodes(self.desk.plan, named.get("sensors", ()))
        self.desk.flows = [n for n in named.get("flows", ()) if n in self.desk.plan.circuit.elements] or self.desk.flows
        if "models" in named:
            self.desk.models = [k for k in named["models"] if k in response.MODELS]

    def build(self, said: str) -> None:
        """Build the page."""
        sub = "Valve to muscle; every change shows in the step response at once"
        with page_frame("circuit", sub=sub, sheets=("circuit.css",), scripts=("js/circuit.js",)) as bar:
            with bar:
                self.undo_button = button("Undo", self._undo, key="Ctrl Z").set(id="circuit-undo")
                button("Load", lambda: load_dialog(self))
                button("Save as", lambda: save_dialog(self))
                button("Use on the bench", lambda: self._guarded(lambda: to_bench(self)), primary=True)
            self.refusal = box("div", "circuit-said")
            with box("div", "circuit-grid") as host:
                host.set(id="circuit-host")
                with box("section", "panel pal").set(aria_label="Parts"):
                    palette()
                with box("div", "circuit-middle"):
                    with panel("Diagram") as head:
                        with head:
                            hint = "drag a part onto the diagram, or select and press Insert and its letter"
                            text("span", hint, "small faint hint")
                            self.chip = raw("", "span", "chip").set(role="status")
                        saveable(head, "Circuit", lambda _: circuit_diagram.draw(self.desk.plan.circuit))
                        self.drawing = raw("", "div", "drawing").set(data_drawing="1")
                    with panel("Step response") as head:
                        with head:
                            self.inputs = box("div", "row")
                            text("span", "compare with", "small faint")
                            self.compare = box("div", "seg s").set(role="group", aria_label="Compare with")
                        self.waveform = box("div")
                        with box("div", "answer"):
                            self.said = box("div", "said").set(role="status")
                            self.pressure = charts.ChartPlace(classes="curve")
                            self.flow = charts.ChartPlace(classes="curve")
                self.inspector = box("section", "panel ins").set(aria_label="Selection")
            host.on_value("circuit-pick", lambda value: self.select(str(value.get("part", ""))[:80]))
            host.on_value("circuit-put", self._put)
            host.on_value(
                "circuit-take", lambda value: self._remove(str(value.get("part", ""))[:80] or self.desk.chosen)
            )
        page_document().on_close(self.desk.leave)
        say_refused(self.refusal, said)
        self.select(self.desk.chosen, moved=False)
        self.renew()

    # ---- what a person does

    def _guarded(self, do: Callable[[], object]) -> bool:
        try:
            do()
        except InputError as error:
            say_refused(self.refusal, error)
            return False
        self.refusal.clear()
        return True

    def _put(self, value: Any) -> None:
        part, at = str(value.get("part", ""))[:40], str(value.get("at", ""))[:80] or self.desk.chosen
        desk = self.desk
        if part == "pressure":
            node = at if at in desk.plan.nodes else circuits.line(desk.plan, at)[0]
            if desk.plan.nodes[node].kind in circuits.GIVEN:
                why = "would show what is given; choose a node whose pressure changes"
                say_refused(self.refusal, f"a pressure sensor at {node} {why}")
                return
            desk.toggle(desk.sensors, node)
        elif part == "flow":
            near = [e for e, (ends, _) in desk.plan.circuit.ends.items() if at in ends]
            desk.toggle(desk.flows, at if at in desk.plan.circuit.elements else (near or desk.flows)[0])
        else:
            self._guarded(lambda: desk.take(*circuits.insert(desk.document, desk.plan, part, at)))
        self._renewed()

    def _renewed(self) -> None:
        """Show what is selected, and the response, after parts have changed."""
        self.select(self.desk.chosen, moved=False)
        self.renew()

    def _remove(self, name: str) -> None:
        if name and self._guarded(
            lambda: self.desk.take(circuits.remove(self.desk.document, self.desk.plan, name), "")
        ):
            self._renewed()

    def _undo(self) -> None:
        if self.desk.undo():
            self.refusal.clear()
            self._renewed()

    def open(self, circuit: Document) -> None:
        """Open another circuit; Undo brings back the previous one."""
        self.desk.take(circuit, "")
        self.desk.sensors = response.shown_nodes(self.desk.plan, ())
        self.refusal.clear()
        self._renewed()

    def change(self, make: Callable[[Document], Document]) -> None:
        """Set the value of a field; raises an error if it is not permitted."""
        if self.desk.take(make(self.desk.document)):
            self.select(self.desk.chosen, moved=False)
        self.refusal.clear()
        self.renew()

    def change_whole(self, make: Callable[[Document], Document]) -> None:
        """Apply a choice; an error is shown above the diagram."""
        if self._guarded(lambda: self.desk.take(make(self.desk.document))):
            self._renewed()

    # ---- what is shown

    def select(self, name: str, moved: bool = True) -> None:
        """Select a part and show its fields."""
        desk = self.desk
        desk.chosen = name if name in desk.parts() else ""
        self.inspector.clear()
        with self.inspector:
            with box("div", "hd"):
                with box("h2"):
                    text("span", desk.chosen.replace("_", " ").capitalize() or "Run")
                    kind = desk.plan.nodes[name].kind if desk.chosen in desk.plan.nodes else ""
                    kind = kind or str(desk.document["elements"].get(desk.chosen, {}).get("kind", ""))
                    text("small", "" if kind == desk.chosen else kind.replace("_", " "))
                box("span", "grow")
                if desk.chosen:
                    button("Remove", lambda: self._remove(desk.chosen), small=True, quiet=True, key="Del")
            with box("div", "bd fields"):
                tube = desk.chosen

                def model(kind: str) -> None:
                    self.change_whole(lambda d: response.with_model(d, desk.plan, tube, kind))

                self.fields = inspector.show(desk.document, desk.plan, tube, self.change, model)
            with box("div", "hd line"), box("h2"):
                text("span", "Effect in this circuit")
            self.numbers = box("div", "bd")
            self.swept = box("div", "bd line")
        if moved:
            self.renew(quiet=True)

    def renew(self, quiet: bool = False) -> None:
        """Redraw after a change, and compute the response."""
        desk = self.desk
        if quiet:
            desk.number += 1
        if not desk.compiled():
            self._around()
            self.said.clear()
            with self.said, loading("Compiling the response of this circuit, some seconds", classes="small-wait"):
                pass
        self._chip("", "")
        page_document().spawn(follow(desk, self._show, self._after, self._checked, self._failed))

    def _around(self) -> None:
        desk = self.desk
        self.drawing.put(diagram.svg(desk.plan, chosen=desk.chosen, sensors=desk.sensors, flows=desk.flows))
        self.undo_button.set(disabled=not desk.undoes)
        self._heads()
        link(**desk.link())

    def _heads(self) -> None:
        """Build the inputs and models to choose from, unless they are those that are shown."""
        desk = self.desk
        full = circuits.top(desk.document, desk.plan)
        now = circuits.input_of(desk.document, desk.plan)
        shown = full, now, tuple(desk.models), str(desk.document.get("signals"))
        if shown == self.heads:
            return  # what somebody types there stays
        self.heads = shown
        self.inputs.clear()
        high = with_unit(parse(full, "Pa", field="pressure"), "Pa")
        names = {"up": f"0 to {high}", "down": f"{high} to 0", "waveform": "Waveform"}

        def pressed(value: str, words: str, on: bool, do: Callable[[str], None]) -> None:
            one = text("button", words).set(type="button", aria_pressed="true" if on else "false")
            one.on("click", lambda: do(value))

        with self.inputs, box("div", "seg s").set(role="group", aria_label="Input"):
            for value, words in names.items():
                pressed(value, words, value == now, self._input)
        self.waveform.clear()
        if now == "waveform":
            self._input(now)
        self.compare.clear()
        with self.compare:
            for kind, words in response.MODELS.items():
                pressed(kind, words.capitalize(), kind in desk.models, self._model)

    def _input(self, value: str) -> None:
        if value == "waveform":
            self.waveform.clear()
            with self.waveform:
                waveform_dialog(self)
            return
        self.heads = None  # the waveform is put away
        self.change_whole(lambda d: circuits.stepped(d, self.desk.plan, value == "up"))

    def _model(self, kind: str) -> None:
        models = self.desk.models
        models.remove(kind) if kind in models else models.append(kind)
        self.renew(quiet=True)

    def _chip(self, sign: str, words: str) -> None:
        self.chip.put(sign + words)
        self.chip.style(display=None if words else "none")

    def _show(self, answer: CircuitAnswer) -> None:
        try:
            show_cautions(self.desk.plan.cautions, self.fields, self.said)
        except MckibbenError as error:
            say_refused(self.said, f"{error}.")
        charts.update(self.pressure, pressure_chart(self.desk, answer))
        charts.update(self.flow, flow_chart(self.desk, answer.record))

    def _after(self, answer: CircuitAnswer) -> None:
        self.numbers.clear()
        with self.numbers:
            numbers(self.desk, answer.numbers)
        self._around()

    def _checked(self, closed: RunBalance | None, swept: response.ValueSweep | None) -> None:
        if closed is None:
            self.swept.clear()
            if swept is not None:
                with self.swept:
                    sweep_chart(swept)
            return
        method, step = self.desk.method, self.desk.plan.inner_step * 1e6
        words = "rk4" if method is None or not method.stiff else "ros2"
        split = 1 if method is None else method.split
        self._chip(TICK, f" closed, mass balance {float(closed.mass):.0e}, {words} at {step / split:.3g} \u00b5s")

    def _failed(self, words: str) -> None:
        self._around()
        say_refused(self.said, words)


# ---- dialogs: open and save circuits, waveforms as text, use on the bench

NAME = "circuit"  # of a rig, where the circuit has no name of its own


def load_dialog(page: CircuitPage) -> None:
    """Build the dialog of saved circuits, examples, and a place for a file."""
    dialog = Dialog("Load a circuit", "circuit-dialog", "bd circuits", once=True)

    def take(circuit: Document, name: str = "") -> None:
        page.open(circuit)
        link(file=name or None)
        dialog.close()

    def read(file: str) -> None:
        try:
            take(read_text(page.shelf.found(file).read_text(encoding="utf-8")), file.removesuffix(".toml"))
        except InputError as error:
            say_refused(said, error)

    def came(one: IncomingFile) -> None:
        if not one.name.lower().endswith(".toml"):
            raise InputError("file", one.name[:120], "must be a .toml file; nothing was stored")
        try:
            take(read_text(one.content().decode("utf-8")))
        except UnicodeDecodeError:
            raise InputError("file", one.name[:120], "must be TOML in UTF-8; nothing was stored") from None

    with dialog:
        text("h3", "Examples")
        for title, circuit in starts().items():
            button(title, lambda c=circuit: take(c), quiet=True)
        saved = page.shelf.names()
        text("h3", "Saved")
        if not saved:
            text("p", "No circuit was saved yet.", "small dim")
        said = box("div")
        for file in saved:
            button(file.removesuffix(".toml"), lambda f=file: read(f), quiet=True)

        UploadPlace("Drop a circuit's .toml file here", came, (".toml",))
    dialog.open()


def save_dialog(page: CircuitPage) -> None:
    """Build the dialog to save or download the circuit."""
    dialog = Dialog("Save the circuit", "circuit-dialog", "bd", once=True)
    with dialog:
        with box("div", "f"):
            text("label", "Name").set(for_="circuit-name")
            with box("div", "field"):
                typed = box("input").set(id="circuit-name", placeholder="name", autocomplete="off")
        said = box("div")
        with box("div", "row"):
            done = button("Save", primary=True)
            button("Download", lambda: download("circuit.toml", text_of(page.desk.document).encode()))
        text("p", "A saved circuit runs on the command line too: mckibben circuit run FILE.toml", "small dim")

    def keep(name: str) -> None:
        try:
            page.shelf.write_text(f"{name}.toml", text_of(page.desk.document))
        except InputError as error:
            say_refused(said, error)
            return
        link(file=name)
        tell(f"Saved as {name}.")
        dialog.close()

    name = ""

    def typed_in(words: object) -> None:
        nonlocal name
        name = str(words)[:200]

    typed.on_value("input", typed_in)
    typed.on_value("entered", lambda value: keep(str(value)[:200]))
    done.on("click", lambda: keep(name))
    dialog.open()


def waveform_dialog(page: CircuitPage) -> None:
    """Build the dialog of the signals as text."""
    signals = page.desk.document.get("signals")
    if not signals:
        words = "Nothing in this circuit is driven: it only fills or empties from its start pressures."
        text("p", words, "small dim note-line")
        return
    with box("div", "waveform"):
        text("label", "Signals, as the file states them").set(for_="circuit-signals")
        words = text_of({"signals": signals})
        area = text("textarea", words, "text").set(id="circuit-signals", spellcheck="false", rows="6")
        said = box("div", "err-place")

    def came(typed: str) -> None:
        said.clear()
        try:
            if len(typed) > LARGEST:
                raise InputError("signals", None, f"must be at most {LARGEST} characters, got {len(typed)}")
            signals = parse_toml(typed, where="signals").get("signals", {})
            read_text(text_of({**page.desk.document, "signals": signals}))
            page.change(lambda d: {**d, "signals": signals})
        except InputError as error:
            say_refused(said, error)

    area.on_value("change", lambda value: came(str(value)))


def to_bench(page: CircuitPage) -> None:
    """Take the circuit as the plumbing of the bench's rig, and its muscle as the bench's muscle."""
    plan = page.desk.plan
    muscle, rigs = muscle_of(plan), Shelf(page.workspace.recordings.folder / "rigs", (".toml",))
    rigs.write_text(f"{NAME}.toml", rig_text(plan, NAME))
    call_script("toBench", [["muscle", muscle], ["rig", NAME]])  # in the order of the link of the bench
