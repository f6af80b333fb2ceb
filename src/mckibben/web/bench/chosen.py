"""Muscle, rig and protocol on the bench, the muscle drawn to scale, and the dry run that follows every change."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...assembly.build import rig_unit
from ...bench.prepare import PreparedRun
from ...bench.protocol_run import compile_run
from ...bench.rig import Rig
from ...bench.rig_file import rig as rig_of
from ...bench.rig_file import rig_names
from ...documents import JsonValue
from ...errors import InputError, MckibbenError
from ...experiments.dry_run import Limits, check_lengths
from ...experiments.protocol import Protocol
from ...experiments.read import parse_protocol, protocol_names, shipped
from ...muscles import braid
from ...muscles.build import rest_length_of, upper_length_of
from ...muscles.muscle import built_muscle
from ...quantities import with_unit
from ...specimens import Specimen, specimen, specimen_ids, specimens
from ..charts import plain_numbers
from ..shelf import Shelf
from ..stream import factors
from .protocol import DryRun, changed, dry_run, faces, laws

if TYPE_CHECKING:
    from ...muscles.law import TensionLaw

# Of the table [rad]. A straight line between two is off by the square of their distance over 8 sin^2(theta), so they stand
# apart in proportion: the diameter is right to 0.02 % from 2 to 89 degrees.
ANGLES = np.radians(np.geomspace(89.0, 2.0, 160))


def bench_muscles() -> list[Specimen]:
    """Return the specimens that fit a bench, sorted by length."""
    fitting = [s for s in specimens() if s.kind == "mckibben"]
    order = ["nylon", "fiberglass", "bridgestone"]
    return sorted(fitting, key=lambda s: (order.index(s.id) if s.id in order else 9, rest_length_of(s), s.id))


def braid_shape(spec: Specimen, law: TensionLaw | None = None) -> dict[str, JsonValue] | None:
    """Return thread length [m], turns, and whether they were inferred; None if unknown."""
    for group in (spec.laws.get("ideal", {}), spec.laws.get("thick_wall", {}), spec.properties):
        if {"thread_length", "turns"} <= group.keys():
            b, n = (group[k].si(u, field=k) for k, u in (("thread_length", "m"), ("turns", "1")))
            inferred = group["thread_length"].inferred or group["turns"].inferred
            return {"thread_length": b, "turns": n, "inferred": inferred}
    try:
        of_law = braid.braid_of(built_muscle(spec).law if law is None else law)
    except MckibbenError:
        of_law = None
    if of_law is not None:
        return {**of_law._asdict(), "inferred": False}
    # no law states it: the volume at rest and the diameter when shortened do, where both are printed
    group = spec.laws.get(spec.law, {})
    if not {"rest_volume", "shortest_length"} <= group.keys() or "diameter_shortened" not in spec.properties:
        return None
    volume, short = (group[k].si(u, field=k) for k, u in (("rest_volume", "m^3"), ("shortest_length", "m")))
    assert isinstance(volume, float) and isinstance(short, float)
    rest, wide = rest_length_of(spec), spec.property_si("diameter_shortened", "m")
    found = braid.through(rest_length=rest, rest_volume=volume, shortest_length=short, diameter_shortened=wide)
    return None if found is None else {**found._asdict(), "inferred": True}


def braid_table(thread_length: float, turns: float) -> dict[str, list[float | None]]:
    """Tabulate rising length [m], braid angle [rad] and diameter [m] of a braid."""
    length = np.asarray(braid.length_at(ANGLES, thread_length=thread_length))
    wide = np.asarray(braid.diameter(length, thread_length=thread_length, turns=turns))
    columns = {"length": length, "angle": ANGLES, "diameter": wide}
    return {name: plain_numbers(values, 9) for name, values in columns.items()}


def drawn_muscle(spec: Specimen) -> dict[str, JsonValue]:
    """Describe a specimen for the list of a page: a table over the length, so that no formula is in its script."""
    shape = braid_shape(spec)
    drawn = None if shape is None else {**shape, "table": braid_table(shape["thread_length"], shape["turns"])}
    return {"id": spec.id, "title": spec.title, "rest_length": rest_length_of(spec), "law": spec.law, "braid": drawn}


# ---- the choice

FIRST = "work-loop"  # protocol with which a bench begins
LONGEST = 100_000  # characters of a protocol's text
MOST_OWN = 6  # specimens of the user's, the newest ones, that are offered
MARGIN = 0.08  # of the rest length, beside the lengths that a muscle reaches


class BenchChoice(NamedTuple):
    """What is selected: muscle, rig and protocol.

    Attributes:
        edits: words of the numbers of a saved protocol that were changed, by name; None where its text was.
    """

    spec: Specimen
    rig: Rig
    protocol: Protocol
    edits: dict[str, str] | None


class BenchSelection:
    """The selected muscle, rig and protocol of a bench.

    Args:
        own: folder of a user's protocols.
        news: told that something is not as it was.
        muscle: at first; a specimen's id.
        rig: at first; or its name.
        machine: words of a real one, whose rig stays; empty for a simulated one.

    Attributes:
        dry: dry run of the choice; None while it is being made.
    """

    def __init__(self, own: Shelf, news: Callable[[], None], *, muscle: str, rig: Rig | str, machine: str) -> None:
        self.own, self._news, self.machine = own, news, machine
        self.rigs = Shelf(own.folder.parent / "rigs", (".toml",))  # such as the circuit page makes of a circuit
        self._lock, self._number = threading.RLock(), 0
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="dry run")
        self._warming, self._closed = ThreadPoolExecutor(1, thread_name_prefix="compile"), False
        self.specimens = Shelf(own.folder.parent / "specimens", (".toml",))  # such as the Fit page makes of a table
        self._own: dict[tuple[str, int], Specimen | None] = {}
        self.muscles = self._muscles()
        self.spec = self._muscle(muscle)
        self.rig = self._first = rig_of(rig) if isinstance(rig, str) else rig
        self.protocol: Protocol = shipped(FIRST)
        self.edits: dict[str, str] | None = {}  # see `BenchChoice`
        self.dry: DryRun | None = None
        self.parts: dict[str, Any] = {}
        self.told: Callable[[DryRun], None] = lambda dry: None

    def begin(self) -> None:
        """Make the first dry run."""
        self._renew(setup=True)

    @property
    def choice(self) -> BenchChoice:
        """What is selected."""
        return BenchChoice(self.spec, self.rig, self.protocol, self.edits)

    def restore(self, choice: BenchChoice) -> str:
        """Select what was selected before."""
        setup = choice[:2] != self.choice[:2]
        self.spec, self.rig, self.protocol, self.edits = choice
        self._renew(setup=setup)
        return f"{self.words()}, protocol {self.protocol.name}"

    def muscle(self, name: str) -> str:
        """Select a muscle."""
        self.spec = self._muscle(name)
        self._renew(setup=True)
        return f"{name}: {self.spec.title}"

    def _muscle(self, name: str) -> Specimen:
        if name not in self.muscles:
            self.muscles = self._muscles()  # a fit may have added one
        if name in specimen_ids("biological"):
            cure = f"stimulate it on the page Compare, or with mckibben run twitch --muscle {name}"
            sentence = f"{name} is a biological muscle, which has no valve: {cure}"
            raise InputError("muscle", name, sentence=sentence)
        if name not in self.muscles:
            raise InputError("muscle", str(name)[:80], known=self.muscles)
        return self.muscles[name]

    def _muscles(self) -> dict[str, Specimen]:
        """Return the muscles of the package, and the newest of the user's that have a length."""
        names = self.specimens.names()[:MOST_OWN]
        own = {Path(name).stem: self._read(self.specimens.found(name)) for name in names}
        shipped = {s.id: s for s in bench_muscles()}
        return shipped | {name: spec for name, spec in own.items() if spec is not None and name not in shipped}

    def _read(self, path: Path) -> Specimen | None:
        """Read one of the user's specimens, by its file's name; None if it fits no bench."""
        key = path.name, path.stat().st_mtime_ns
        if key not in self._own:
            try:
                spec = replace(specimen(path), id=path.stem, title=path.stem)
                rest_length_of(spec)
                self._own[key] = spec if spec.kind == "mckibben" else None
            except MckibbenError:
                self._own[key] = None
        return self._own[key]

    def choose_rig(self, name: str) -> str:
        """Select a shipped rig or one of the user's."""
        if name not in (known := self._rigs()):
            raise InputError("rig", str(name)[:80], known=known)
        if name == self._first.name:
            self.rig = self._first
        else:
            self.rig = rig_of(name if name in rig_names() else self.rigs.found(f"{name}.toml"))
        self._renew(setup=True)
        return f"{name}: {self.rig.title}"

    def _rigs(self) -> dict[str, str]:
        names = [n.removesuffix(".toml") for n in self.rigs.names()]
        those = {n: rig_of(n).title for n in rig_names()}
        return those | {n: f"Your own: {n}" for n in names} | {self._first.name: self._first.title}

    def load(self, name: str) -> str:
        """Select a shipped protocol or one of the user's by name."""
        if name in protocol_names():
            self.protocol = shipped(name)
        else:
            mine = f"{name}.toml"
            try:
                path = self.own.found(mine)
            except InputError:
                known = [*protocol_names(), *(n.removesuffix(".toml") for n in self.own.names())]
                raise InputError("protocol", str(name)[:80], known=known) from None
            self.protocol = parse_protocol(path.read_text(encoding="utf-8"), where=mine)
        self.edits = {}
        self._renew()
        return f"{self.protocol.name}: {self.protocol.title}"

    def value(self, name: str, words: str) -> str:
        """Change a parameter or choice of the protocol."""
        words = str(words)[:2000]
        self._take(
            changed(self.protocol, str(name), words), None if self.edits is None else self.edits | {str(name): words}
        )
        return ""

    def text(self, text: str) -> str:
        """Replace the protocol by the text of a file."""
        if len(text) > LONGEST:
            raise InputError("text", None, f"must be at most {LONGEST} characters, got {len(text)}")
        self._take(parse_protocol(str(text), where="text"), None)
        return f"{self.protocol.name}: {self.protocol.title}"

    def _take(self, protocol: Protocol, edits: dict[str, str] | None) -> None:
        check_lengths(protocol, self._limits(), rest_length_of(self.spec))
        self.protocol, self.edits = protocol, edits
        self._renew()

    def _limits(self) -> Limits:
        return self.rig.limits(next(iter(self.rig.plumbing)))

    def save(self, name: str) -> str:
        """Save the protocol among the user's under a name."""
        self.own.path(f"{name}.toml")
        if name in protocol_names():
            raise InputError("protocol", name, "must be another name; this one ships with mckibben")
        self.own.write_text(f"{name}.toml", self.protocol.toml())
        self._renew()
        return f"Saved as {name}."

    def passed(self) -> PreparedRun:
        """Return the prepared run if its dry run has passed."""
        dry = self.dry
        if dry is None:
            raise InputError("start", None, "must wait for the dry run, which is not done yet")
        if dry.prepared is None or not dry.passed:
            raise InputError("start", None, f"needs a dry run that passes: {dry.plain['findings'][0]['sentence']}")
        return dry.prepared

    def refusal(self, spec: Specimen) -> str:
        """Return why the protocol cannot run with another muscle on this rig; empty where its dry run passes."""
        try:
            dry = dry_run(self.protocol, spec, rig_unit(spec), self.rig, on_machine=bool(self.machine))
        except MckibbenError as error:
            return str(error)
        return "" if dry.passed else str(dry.plain["findings"][0]["sentence"])

    def again(self) -> str:
        """Repeat the dry run."""
        self._renew()
        return ""

    def cure(self) -> str:
        """Take the value with which the dry run passes."""
        cure = None if self.dry is None else self.dry.plain.get("cure")
        if not cure:
            raise InputError("cure", None, "cannot be found: no smaller value of one number fits")
        return self.value(cure["name"], cure["words"])

    def _renew(self, setup: bool = False) -> None:
        with self._lock:
            self._number += 1
            self.dry = None
            changes = {"setup": self._setup()} if setup else {}
            known = [{"name": n, "title": shipped(n).title} for n in protocol_names()]
            known += [{"name": n.removesuffix(".toml"), "title": n.removesuffix(".toml")} for n in self.own.names()]
            changes |= {
                "protocol": {**faces(self.protocol), "known": known, "edits": self.edits},
                "dry": {"pending": True},
            }
            self.parts = {**self.parts, **changes}
            number = self._number
        self._pool.submit(self._make, number, setup)
        self._news()

    def _make(self, number: int, setup: bool) -> None:
        if number != self._number and not setup:
            return
        try:
            unit = rig_unit(self.spec)
            if setup:
                curves = self._laws(unit)
                with self._lock:  # what was chosen meanwhile stays
                    self.parts = {**self.parts, "laws": curves}
            dry = dry_run(self.protocol, self.spec, unit, self.rig, on_machine=bool(self.machine))
        except MckibbenError as error:
            dry = DryRun.refused(str(error))
        except Exception as error:  # a page has to hear of it, and the next change gets another try
            dry = DryRun.refused(f"the dry run failed: {type(error).__name__}: {str(error)[:200]}")
        with self._lock:
            if number != self._number:
                return
            self.dry = dry
            self.parts = {**self.parts, "dry": dry.plain}
        self.told(dry)
        self._news()
        prepared = dry.prepared
        if prepared is None or not dry.passed or self.machine:
            return

        def warm() -> None:
            """Compile in the background what a start of this selection needs."""
            with contextlib.suppress(MckibbenError):  # the run will say it
                compile_run(prepared, lambda: number == self._number and not self._closed)

        self._warming.submit(warm)

    def _setup(self) -> dict[str, JsonValue]:
        limits = self._limits()
        rest = rest_length_of(self.spec)
        return {
            "muscles": [drawn_muscle(s) for s in self.muscles.values()],
            "biological": specimen_ids("biological"),
            "muscle": self.spec.id,
            "rest_length": rest,
            "rigs": [{"name": n, "title": t} for n, t in self._rigs().items()],
            "rig": self.rig.name,
            "rig_title": self.rig.title,
            "machine": self.machine,
            "plumbing": list(self.rig.plumbing),
            "units": factors(),
            "limits": {
                "pressure": [limits.pressure[0], limits.pressure[1]],
                "tension": [0.0, limits.tension],
                "length": [limits.span[0], limits.span[1]],
            },
            "inferred": self.spec.inferred(),
            "has_motor": self.rig.motor is not None,
        }

    def _laws(self, unit: Any) -> dict[str, JsonValue]:
        rest, limits = rest_length_of(self.spec), self._limits()
        free = float(np.asarray(unit.law.free_length(limits.pressure[1])))
        longest = max(rest, upper_length_of(self.spec, unit.law) if "upper_length" in self.spec.properties else rest)
        low, high = free - MARGIN * rest, longest + MARGIN * rest
        ends = {"low": low, "high": high, "free": free, "longest": longest}
        return {"title": type(unit.law).title, **ends, "lines": laws(unit, low, longest, limits.pressure[1])}

    def words(self) -> str:
        """Describe muscle and rig for a message."""
        return f"{self.spec.title} on the rig {self.rig.name}, rest length {with_unit(rest_length_of(self.spec), 'm')}"

    def close(self) -> None:
        """Stop the dry runs and compilations."""
        self._closed = True
        for pool in (self._pool, self._warming):
            pool.shutdown(wait=True, cancel_futures=True)
