"""The bar of the page Energy: slider and field of the supply's pressure, cycle, exchange, friction, and the conditions."""

from __future__ import annotations

import functools
import json
from typing import TYPE_CHECKING, Any

from ....analysis.energy import READINGS
from ....analysis.energy.cycles import SETTINGS, coulomb_friction, stretched_length
from ....errors import InputError, MckibbenError
from ....quantities import from_si
from ...forms import accept, field
from ...widgets import box, raw, refused, segments, select, text
from .choice import Choice, conditions, resolved
from .cycles import TITLES

if TYPE_CHECKING:
    from .view import View

LOW, HIGH, STEP = 1.0, 10.0, 0.1  # of the slider [bar]
SIGN = (
    '<svg class="key" width="26" height="12" viewBox="0 0 26 12" aria-hidden="true"><path d="M0 6H26" '
    'stroke="var(--q-pressure)" stroke-width="2"/><circle cx="13" cy="6" r="3.4" fill="var(--q-pressure)" '
    'stroke="var(--panel)" stroke-width="1.2"/></svg>'
)
VOLUMES = {"": "Volume as usual", "paper": "Volume of eq. 38b", "potential": "Volume of the law"}


class Controls:
    """Of one visitor."""

    def __init__(self, view: View) -> None:
        self.view, self.again = view, False
        self.bar = box("section", "panel supply").set(aria_label="Cycle")
        self.more = box("details", "panel conditions")
        self.under = box("div", "e-under")
        self.rebuild()

    def rebuild(self) -> None:
        """Show the choice as it is."""
        self.again = self.refused = False
        self.bar.clear()
        self.more.clear()
        with self.bar:
            self._pressure()
            self._choices()
        with self.more:
            self._conditions()

    def refuse(self, sentence: str) -> None:
        """Say why something was not done."""
        self.under.clear()
        with self.under:
            refused(sentence)

    def agree(self, *, rebuilt: bool) -> None:
        """What was chosen is shown now."""
        if rebuilt or self.again:
            self.rebuild()
        self._say_conditions()

    # ---- pressure

    def _pressure(self) -> None:
        choice = self.view.choice
        value = from_si(choice.pressure, "Pa", "bar")
        high = max(HIGH, value)
        raw(f"{SIGN}Supply pressure", "label", "P lead").set(for_="supply-pressure")
        self.track = box("div", "tr P")
        with self.track:
            box("i")
            dragged = box("input").set(
                id="supply-pressure",
                type="range",
                min=LOW,
                max=f"{high:g}",
                step=STEP,
                value=f"{value:g}",
                aria_label="Supply pressure, bar",
            )
        self.track.set(data_spec=json.dumps(value))
        dragged.on_value("input", self.dragged, wait=0.08)
        with box("div", "number"):
            with box("div", "field P") as self.edge:
                self.typed = box("input").set(
                    value=f"{value:.6g}",
                    inputmode="decimal",
                    aria_label="Supply pressure",
                    aria_describedby="supply-said",
                )
                text("span", "bar", "u")
            self.said = box("div", "said").set(id="supply-said")
        self.typed.on_value("change", self.entered)

    def dragged(self, given: object) -> None:
        """The slider was moved."""
        value = float(str(given))
        if self.refused:  # else the browser has the number already
            self.refusal("", f"{value:.6g}")
        self.typed.set(value=f"{value:.6g}")
        self.view.changed(pressure=min(max(value, LOW), max(HIGH, value)) * 1e5 if value == value else 5e5)

    def entered(self, words: object) -> None:
        """A number was typed; refused beside the field, in the words of the command line."""
        choice = self.view.choice
        found = accept("pressure", str(words)[:60], SETTINGS["pressure"], choice.pressure)
        why = found.said
        if not why:
            try:
                conditions(_with(choice, pressure=found.value))
            except MckibbenError as error:
                why = f"{error}. The old value, {from_si(choice.pressure, 'Pa', 'bar'):.6g}, stays in use."
        self.refusal(why, str(words)[:60] if why else f"{from_si(found.value, 'Pa', 'bar'):.6g}")
        if not why:
            self.track.set(data_spec=json.dumps(from_si(found.value, "Pa", "bar")))
            self.view.changed(pressure=found.value)

    def refusal(self, why: str, words: str) -> None:
        """Say under the number why it was refused, and leave the words to be put right; no sentence takes that away."""
        self.said.clear()
        self.refused = bool(why)
        self.typed.set(value=words)
        self.edge.classed("bad", bool(why))
        self.typed.set(aria_invalid="true" if why else "false")
        if why:
            with self.said:
                refused(why)

    # ---- the rest

    def _choices(self) -> None:
        choice, go = self.view.choice, self.view.changed
        own = coulomb_friction(resolved(choice).spec) if choice.friction is None else choice.friction
        own = own or coulomb_friction(resolved(choice).spec)
        segments(TITLES, choice.cycle, lambda v: go(cycle=v), "Cycle")
        segments(
            {"atmosphere": "Atmosphere", "accumulator": "Accumulator"},
            choice.exchange,
            lambda v: go(exchange=v),
            "Exchange",
        )
        rubs = {"as": f"Friction {own:g}\u2009\u2060N", "none": "None"} if own else {"none": "No friction"}
        pressed = "none" if choice.friction == 0.0 or not own else "as"
        usual = own if choice.friction not in (None, 0.0) else None
        segments(rubs, pressed, lambda v: go(friction=0.0 if v == "none" else usual), "Friction")

    def _conditions(self) -> None:
        choice = self.view.choice
        self.line = text("summary", "Conditions")
        found = resolved(choice)
        muscle = next(iter(found.muscles.values()))
        values = {
            "stretched_length": stretched_length(found.spec, muscle)
            if choice.stretched_length is None
            else choice.stretched_length,
            "accumulator_pressure": float(muscle.threshold())
            if choice.accumulator_pressure is None
            else choice.accumulator_pressure,
            "friction": coulomb_friction(found.spec) if choice.friction is None else choice.friction,
        }
        with box("div", "bd form"):
            for name, value in values.items():
                field(name, SETTINGS[name], value, functools.partial(self._set, name))
            with box("div", "row wrap"):
                if len(found.spec.laws) > 1:
                    names = {n: n.replace("_", " ") for n in found.spec.laws}
                    select(names, found.law, lambda v: self.view.changed(law=v, volume=""), "Law")
                volumes = {v: VOLUMES[v] for v in sorted(found.muscles)}
                select(volumes, found.volume, lambda v: self.view.changed(volume=v), "Volume of the gas")
                words = {"printed": "Friction in the output only", "throughout": "Friction throughout"}
                readings = {r: words[r] for r in READINGS}
                select(
                    readings, choice.reading, lambda v: self.view.changed(reading=v), "Reading of the isotonic cycles"
                )
        self._say_conditions()

    def _set(self, name: str, value: float) -> None:
        """Take a condition; refused, with the old value kept, where no cycle is possible."""
        choice = _with(self.view.choice, **{name: value})
        conditions(choice)
        if name == "accumulator_pressure" and value >= choice.pressure:
            raise InputError(name, f"{value / 1e5:g} bar", "allowed is below the pressure of the supply")
        self.again = name == "friction"  # which the bar shows too
        self.view.changed(**{name: value})

    def _say_conditions(self) -> None:
        from ....quantities import with_unit

        try:
            c = conditions(self.view.choice)
        except MckibbenError:
            return
        around = with_unit(float(c.ambient.pressure_abs), "Pa", 5)
        volume = VOLUMES[resolved(self.view.choice).volume].lower()
        words = f"Conditions: begins at {with_unit(c.stretched_length, 'm')}, surroundings {around}, {volume}"
        self.line.say(words)


def _with(choice: Choice, **what: Any) -> Choice:
    from dataclasses import replace

    return replace(choice, **what)
