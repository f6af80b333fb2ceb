"""The verb `compare`: muscles by their laws, recordings beside them, and on request equal protocols and a match."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from ..._lazy import LazyModule
from ...answers import Caution, collect
from ...errors import InputError
from ...muscles import Muscle
from ...muscles.evidence import law_cautions
from ...muscles.law import law_name
from ...muscles.plausible import free_length_caution, pressure_caution
from ...specimens import Specimen, muscle_specimen
from ...specimens.published import published_ranges
from ...verbs import LawName, MuscleName, NamedValues, Pressure, RecordingFile, RigName, typed, verb
from .table import Comparable, ComparedMuscle, MuscleTable, column_of, law_column, subject

if TYPE_CHECKING:
    from . import match as matching
    from . import protocols as equal_protocols
    from .match import Match
    from .protocols import Trials
else:  # what runs protocols and searches takes a second to import
    matching, equal_protocols = (LazyModule(f"{__package__}.{name}") for name in ("match", "protocols"))


@verb
def compare(
    *muscles: MuscleName,
    recordings: Sequence[RecordingFile] = (),
    pressure: Pressure = "5 bar",
    protocols: bool = False,
    stimulation: NamedValues | None = None,
    match: MuscleName | None = None,
    rig: RigName | None = None,
    law: LawName | None = None,
    progress: Callable[[str], None] | None = None,
) -> MuscleTable:
    """Compare muscles with each other, and with published biological muscle.

    The rows are those of the paper's Table 1.

    Args:
        muscles: specimens by id or .toml file; in Python also muscles, or a list of them.
        recordings: recording to show as a further column, with the names of its muscle's rest length.
        pressure: gauge pressure that counts as the full drive of McKibben muscles [Pa].
        protocols: also run twitch, step, release, force-velocity and work loop on each muscle.
        stimulation: stimulate biological muscles in the work loop: phase, duty, rate or width, such as phase='60 deg'
            or duty=0.3.
        match: also search elements that bring each McKibben muscle close to this biological one.
        rig: rig for protocols and match; by default the paper's where its range allows.
        law: law to use for the muscles that state it instead of their default.
        progress: called with a description of the next stage, at most `stages` times.

    Raises:
        InputError: nothing to compare, what a muscle or a recording lacks, or options that exclude each other.

    Examples:
        >>> import mckibben as mk
        >>> mk.compare("nylon", "fast-fibre")
        MuscleTable(nylon, fast-fibre: 16 properties)
    """
    if rig is not None and not protocols and match is None:
        raise InputError("rig", None, "is allowed only with {protocols} or {match}, which run on it")
    if stimulation is not None:
        if not protocols:
            raise InputError("stimulation", None, "is allowed only with {protocols}, whose work loop it drives")
        equal_protocols.stimulated_loop(stimulation)
    full = float(pressure)
    subjects = _subjects(muscles, full, law)
    braided = [s for s in subjects if s.unit is not None]
    said = collect(*(one for s in braided for one in _cautions(s, full, typed(pressure))))
    target = None if match is None else _target(match, subjects)
    columns = [law_column(s) for s in subjects] + [column_of(file) for file in recordings]
    if not columns:
        raise InputError("muscles", None, "are missing: a specimen's id or file, or a recording")
    done: list[Trials] = []
    if protocols:
        on = rig or equal_protocols.rig_for(subjects)
        for one in subjects:
            done.append(equal_protocols.trials(one, rig=on, stimulation=stimulation, progress=progress))
        columns[: len(done)] = [trial.column() for trial in done]
    matches: list[Match] = []
    if target is not None:
        twitch = matching.TWITCH
        records = {t.muscle.id: t.records[twitch] for t in done if twitch in t.records}
        matches = [matching.match(s, target, records=records, rig=rig, progress=progress) for s in braided]
    return MuscleTable(tuple(columns), published_ranges(), tuple(subjects), tuple(done), tuple(matches), said)


def stages(muscles: Sequence[Specimen], *, protocols: bool = False, match: str | None = None) -> int:
    """Largest number of progress reports of `compare`."""
    runs = len(muscles) * len(equal_protocols.NAMES) if protocols else 0
    searches = 0 if match is None else sum(one.kind == "mckibben" for one in muscles) * matching.STAGES
    return runs + searches


def _subjects(
    muscles: Sequence[Comparable | Iterable[Comparable]], pressure: float, law: str | None
) -> list[ComparedMuscle]:
    """Load the muscles with their full drive [Pa]; with a law where they state it."""
    single = (str, os.PathLike, Specimen, Muscle, ComparedMuscle)
    for one in muscles:
        if not isinstance(one, (*single, Iterable)):
            raise InputError("muscles", None, f"must be names of muscles, files or muscles, got {one!r}")
    listed = [one for m in muscles for one in ([m] if isinstance(m, single) else m)]
    read = [muscle_specimen(one) if isinstance(one, str | os.PathLike) else one for one in listed]
    laws = dict.fromkeys(name for one in read if isinstance(one, Specimen) for name in one.laws)
    if law is not None and law not in laws:
        raise InputError("law", law, f"the muscles state {', '.join(laws) or 'no law'}")
    subjects = []
    for one in read:
        if isinstance(one, ComparedMuscle):
            subjects.append(one)
        else:
            chosen = law if isinstance(one, Specimen) and law in one.laws else None
            subjects.append(subject(one, pressure=pressure, law=chosen))
    return subjects


def _cautions(subject: ComparedMuscle, pressure: float, text: str | None) -> tuple[Caution, ...]:
    """Cautions about a braided muscle at its highest pressure [Pa]: its law, and how far it shortens."""
    assert subject.unit is not None
    law, spec = subject.unit.law, subject.spec
    at_pressure = (pressure_caution(pressure, spec, text=text), free_length_caution(law, [pressure], spec))
    return collect(*at_pressure, *law_cautions(spec, law_name(law)))


def _target(name: str, subjects: Sequence[ComparedMuscle]) -> ComparedMuscle:
    target = subject(name)
    if target.fibre is None:
        raise InputError("match", name, "must be a biological muscle; it is a McKibben muscle")
    if not any(s.unit is not None for s in subjects):
        raise InputError("match", name, "must be a McKibben muscle among those compared")
    return target
