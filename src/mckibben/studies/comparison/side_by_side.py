"""The verb `compare`: muscles by their laws, recordings beside them, and on request equal protocols and a match."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from ..._lazy import LazyModule
from ...answers import collect, warn
from ...errors import InputError
from ...muscles import Muscle
from ...muscles.plausible import pressure_caution
from ...quantities import in_si
from ...recordings import Recording
from ...specimens import Specimen, muscle_specimen
from ...specimens.published import published_ranges
from ...verbs import typed
from .table import FULL_PRESSURE, Comparable, ComparedMuscle, MuscleTable, column_of, law_column, subject

if TYPE_CHECKING:
    from . import match as matching
    from . import protocols as equal_protocols
    from .match import Match
    from .protocols import Trials
else:  # what runs protocols and searches takes a second to import
    matching, equal_protocols = (LazyModule(f"{__package__}.{name}") for name in ("match", "protocols"))


def compare(
    *muscles: Comparable | Iterable[Comparable],
    recordings: Sequence[str | os.PathLike[str] | Recording] = (),
    pressure: float | str = FULL_PRESSURE,
    law: str | None = None,
    protocols: bool = False,
    stimulation: Mapping[str, str] | None = None,
    match: str | None = None,
    rig: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> MuscleTable:
    """Compare muscles with each other and with published biological muscle: Table 1 for their laws and for recordings.

    Args:
        muscles: specimens by id or file, muscles, or a list of them.
        recordings: files of recordings with the names of their muscle's rest length, see `recorded.column_of`.
        pressure: full drive of the McKibben muscles [Pa].
        law: law of the muscles that state it; the others have their default law.
        protocols: also run twitch, step, release, force-velocity and work loop on each muscle.
        stimulation: phase, duty, rate or width of the stimulation of biological muscles in the work loop, in words.
        match: a biological muscle; elements are searched that bring each McKibben muscle close to it.
        rig: on which protocols and match are run; by default the paper's where its range allows.
        progress: called with a description of the next stage, at most `stages` times.

    Raises:
        InputError: nothing to compare, what a muscle or a recording lacks, or options that exclude each other.

    Examples:
        >>> import mckibben as mk
        >>> mk.compare("nylon", "fast-fibre")
        MuscleTable(nylon, fast-fibre: 16 properties)
    """
    if rig is not None and not protocols and match is None:
        raise InputError("rig", None, "is allowed only with protocols or match, which run on it")
    if stimulation is not None:
        if not protocols:
            raise InputError("stimulation", None, "is allowed only with protocols, whose work loop it drives")
        equal_protocols.stimulated_loop(stimulation)
    full = float(in_si(pressure, "Pa", field="pressure"))
    subjects = _subjects(muscles, full, law)
    braided = [s for s in subjects if s.unit is not None]
    said = collect(*(pressure_caution(full, s.spec, text=typed(pressure)) for s in braided))
    warn(said)
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


def _target(name: str, subjects: Sequence[ComparedMuscle]) -> ComparedMuscle:
    target = subject(name)
    if target.fibre is None:
        raise InputError("match", name, "must be a biological muscle; it is a McKibben muscle")
    if not any(s.unit is not None for s in subjects):
        raise InputError("match", name, "must be a McKibben muscle among those compared")
    return target
