"""State of one visitor's circuit: its document, selection and display, and the response that follows every change."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ....assembly.circuit_file import CircuitPlan
from ....documents import JsonValue
from ....errors import InputError, MckibbenError
from ....experiments.waveforms import time_words
from ....pneumatics.circuit import RunBalance
from ....recordings import Recording
from . import response
from .document import Document, packed, planned
from .response import CircuitResponse, IntegrationMethod, accounts, ready, respond

QUIET = 0.6  # after the last change, before the accounts and the small chart follow [s]
LONGEST = 60  # edits that can be undone
SAMPLES = 20_000  # of a response, more than which this page does not draw


class CircuitAnswer(NamedTuple):
    """A response: its recording, numbers, and the pressure of the same node with other tube models [Pa]."""

    record: Recording
    numbers: response.ResponseNumbers
    models: dict[str, np.ndarray]
    waits: bool  # whether further models, or a longer run, have to be compiled
    done: CircuitResponse


class CircuitState:
    """State of one circuit page."""

    def __init__(self, document: Document, chosen: str = "") -> None:
        self.document, self.plan = document, planned(document)
        self.chosen = chosen if chosen in self.parts() else ""
        self.sensors = response.shown_nodes(self.plan, ())
        self.flows = [response.first_tube(self.plan)]
        self.models: list[str] = ["linear_tube"]
        self.number = 0
        self.method: IntegrationMethod | None = None
        self.methods: dict[str, IntegrationMethod] = {}  # of the other tube models
        self._undo: list[tuple[Document, str]] = []

    def parts(self) -> list[str]:
        """Names of all nodes and elements."""
        return [*self.plan.nodes, *self.plan.circuit.elements]

    def take(self, new: Document, chosen: str | None = None) -> bool:
        """Replace the document; return whether parts were added or removed."""
        plan = planned(new)
        check_size(plan)
        self._undo = [*self._undo[-LONGEST:], (self.document, self.chosen)]
        return self._now(new, plan, self.chosen if chosen is None else chosen)

    def undo(self) -> bool:
        """Restore the document before the last change; return False if there is none."""
        if not self._undo:
            return False
        document, chosen = self._undo.pop()
        self._now(document, planned(document), chosen)
        return True

    @property
    def undoes(self) -> bool:
        """Whether there is a change to undo."""
        return bool(self._undo)

    def _now(self, new: Document, plan: CircuitPlan, chosen: str) -> bool:
        before = self.plan
        self.document, self.plan = new, plan
        other = bool(_shape(before) != _shape(plan))
        if other:
            self.method, self.methods = None, {}
            gone = set(before.nodes) | set(before.circuit.elements)
            kept = [n for n in self.sensors if n in plan.nodes]
            came = [n for n in response.shown_nodes(plan, ()) if n not in gone and plan.nodes[n].kind != "junction"]
            self.sensors = response.shown_nodes(plan, [*kept, *came][:5])
            self.flows = [n for n in self.flows if n in plan.circuit.elements] or [response.first_tube(plan)]
        self.chosen = chosen if chosen in self.parts() else ""
        self.number += 1
        return other

    def toggle(self, what: list[str], name: str) -> None:
        """Add a name to a list, or remove it; the last one stays."""
        if name not in what:
            what.append(name)
        elif len(what) > 1:
            what.remove(name)
        self.number += 1

    @property
    def read(self) -> str:
        """Node whose rise is evaluated: the selected one, or the last shown."""
        if self.chosen in self.sensors:
            return self.chosen
        last = response.last_chamber(self.plan)
        return last if last in self.sensors else self.sensors[-1]

    def link(self) -> dict[str, JsonValue]:
        """Parameters of the page's address."""
        return {
            "c": packed(self.document),
            "part": self.chosen,
            "sensors": ",".join(self.sensors),
            "flows": ",".join(self.flows),
            "models": ",".join(self.models) or "none",
        }

    def leave(self) -> None:
        """Discard running computations when the page is closed."""
        self.number += 1

    # ---- in another thread

    def quick(self, wait: bool = False) -> CircuitAnswer:
        """Response by kernels; of tube models and longer runs only compiled ones, or all of them with `wait`."""
        document, plan, node, methods = self.document, self.plan, self.read, self.methods
        done = respond(plan, self.method)
        record = response.recording(plan, done.outputs)
        numbers = response.measured(plan, record, node, self.flows[0])
        numbers, later = response.settled(plan, numbers, node, done.method, wait)
        others, waits = self._others(document, plan, node, methods, wait)
        return CircuitAnswer(record, numbers, others, waits or later, done)

    def compiled(self) -> bool:
        """Whether the response needs no compilation."""
        return ready(self.plan, self.method)

    def _others(
        self, document: Document, plan: CircuitPlan, node: str, methods: dict[str, IntegrationMethod], wait: bool
    ) -> tuple[dict[str, np.ndarray], bool]:
        tube = response.first_tube(plan, self.chosen)
        pressures, waits = {}, False
        for kind in self.models:
            present_kind = document["elements"][tube]["kind"]
            if present_kind not in response.TUBES or present_kind == kind:
                continue
            try:
                other = planned(response.with_model(document, plan, tube, kind))
                if not wait and not ready(other, methods.get(kind)):
                    waits = True
                    continue
                done = respond(other, methods.get(kind))
                methods[kind] = done.method
            except MckibbenError:
                continue
            pressures[kind] = done.outputs[f"{node}.pressure_abs"] - float(plan.environment.pressure_abs)
        return pressures, waits

    def sweep(self) -> response.ValueSweep | None:
        """Rise time over values of the selected part."""
        name = self.chosen or response.first_tube(self.plan)
        return response.sweep(self.document, self.plan, name, self.read, self.method)


def check_size(plan: CircuitPlan) -> None:
    """Refuse a run that is too long for immediate display."""
    if plan.samples > SAMPLES or plan.duration / plan.inner_step > 4e6:
        most = f"this page draws up to {SAMPLES} samples and 4000000 steps; run longer ones with mckibben circuit run"
        raise InputError("run.duration", time_words(plan.duration), most)


def _shape(plan: CircuitPlan) -> Any:
    kinds = {n: words["kind"] for s in ("nodes", "elements") for n, words in plan.document[s].items()}
    return kinds, plan.circuit.ends, plan.samples


async def follow(
    desk: CircuitState,
    show: Callable[[CircuitAnswer], None],
    after: Callable[[CircuitAnswer], None],
    check: Callable[[RunBalance | None, response.ValueSweep | None], None],
    failed: Callable[[str], None],
) -> None:
    """Compute the response at once; when the page is quiet, close its balances and vary the selected part."""
    number = desk.number
    try:
        answer = await asyncio.to_thread(desk.quick)
        if number != desk.number:
            return
        desk.method = answer.done.method  # here, for a late thread knows nothing of a circuit that came meanwhile
        show(answer)
        await asyncio.sleep(0.0)  # the response goes out first
        after(answer)
        if answer.waits:
            answer = await asyncio.to_thread(desk.quick, True)
            if number != desk.number:
                return
            desk.method = answer.done.method
            show(answer)
            after(answer)
        await asyncio.sleep(QUIET)
        if number != desk.number:
            return
        swept = await asyncio.to_thread(desk.sweep)
        if number == desk.number:
            check(None, swept)
        closed = await asyncio.to_thread(accounts, desk.plan, answer.done)
        if number == desk.number:
            check(closed, swept)
    except MckibbenError as error:
        if number == desk.number:
            failed(str(error))
    except Exception as error:  # the page has to hear of it, and the next change gets another try
        if number == desk.number:
            failed(f"the response failed: {type(error).__name__}: {str(error)[:200]}")
