"""The whole question: which muscle, which valve and tube, which gas source for a wish."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ...errors import InputError
from . import catalogue
from .braid_design import OBJECTIVES, design
from .braid_law import BRAID_LAWS
from .candidate import VERDICTS, Candidate, Judged, judged, ranked
from .lines import LENGTHS, LineFound, lines_for
from .supply import SourceFound, piston_cycle, sources_for
from .wish import Miss, Wish

Progress = Callable[[str], None]
MOST_TRIED = 3  # muscles whose speed is looked for


@dataclass(frozen=True, eq=False)
class Sizing:
    """What was found.

    Attributes:
        wish: what was asked.
        muscles: every candidate, the best first.
        misses: what stands in the way of a braid, or of the speed; empty where one does it.
        chosen: for which lines and sources were looked for; the best, or the one asked for.
        lines: valves with tubes for it, the best first; empty where none were looked for.
        lengths: the best valve with tubes of other lengths.
        sources: of gas, those that can do it first.
        piston: input and output of the paper's cycle of maximal shortening without and with an accumulator [J].
    """

    wish: Wish
    muscles: tuple[Judged, ...]
    misses: tuple[Miss, ...]
    chosen: Judged
    lines: tuple[LineFound, ...]
    lengths: tuple[LineFound, ...]
    sources: tuple[SourceFound, ...]
    piston: dict[str, tuple[float, float] | None]

    @property
    def reached(self) -> bool:
        """Whether some muscle does it, beyond the error of its law or by its law; with a speed, one that was run."""
        lined = self.wish.speed is None or not self.lines
        return any(m.verdict != VERDICTS[2] for m in self.muscles if lined or m.speed is not None)

    @property
    def nearest(self) -> Judged:
        """The candidate that comes nearest."""
        return self.chosen if "speed" in self.chosen.margins else self.muscles[0]

    def sentence(self) -> str:
        """What stands in the way, and what would make it reachable."""
        one = self.nearest
        part, margin = one.worst
        said = f"nothing reaches it; nearest is {one.muscle.id}, whose {part} falls short by {-margin:.0%}"
        could = [m for m in self.misses if m.reachable is not None]
        return said + (f"; what would do: {could[0].sentence()}" if could else "")


def size(
    wish: Wish,
    *,
    law: str = BRAID_LAWS[0],
    muscle: str | None = None,
    lines: bool = True,
    progress: Progress | None = None,
) -> Sizing:
    """Find muscles, valves and tubes, and sources.

    Args:
        wish: what is wanted.
        law: of `BRAID_LAWS`, for the braids.
        muscle: id of the candidate for which lines and sources are looked for; the best where left out.
        lines: look for valves and tubes.
        progress: is told what comes next.

    Raises:
        InputError: the law is unknown, or no candidate has that id.
    """
    tell = progress or (lambda _: None)
    tell("braids")
    found: list[Candidate] = []
    misses: tuple[Miss, ...] = ()
    for objective in OBJECTIVES:
        one, missing = design(wish, law=law, objective=objective, fitting=not found and not misses)
        if one is None:
            misses = missing
            break
        found.append(one)
    tell("specimens")
    found += catalogue.of_specimens(wish)
    tell("fluidic muscles")
    found += catalogue.of_sizes(wish)
    order = ranked([judged(one, wish) for one in found])
    chosen = _chosen(order, muscle)
    best: list[LineFound] = []
    other: list[LineFound] = []
    if lines:
        order, chosen, best = _with_lines(order, chosen, muscle is None, wish, tell)
        if best and best[0].to_force is not None:
            other = lines_for(chosen, wish, valves=[best[0].valve], lengths=LENGTHS, progress=tell)
    if wish.speed is not None and chosen.speed is not None and chosen.speed < wish.speed:
        misses = (*misses, Miss("speed", wish.speed, chosen.speed or None))
    line = next((one for one in best if one.to_force is not None), None)
    does = chosen.verdict != VERDICTS[2]  # else there is no work whose energy could be told
    sources = sources_for(chosen, wish, line) if does else []
    ways = ("surroundings", "accumulator")
    piston = {n: piston_cycle(chosen, wish, accumulator=n == "accumulator") if does else None for n in ways}
    return Sizing(wish, tuple(order), tuple(misses), chosen, tuple(best), tuple(other), tuple(sources), piston)


def _with_lines(
    order: list[Judged], chosen: Judged, free: bool, wish: Wish, tell: Progress
) -> tuple[list[Judged], Judged, list[LineFound]]:
    """Lines of the chosen muscle; where a speed is wished that it does not reach, and we are free, of the next ones."""
    tried = [m for m in order if m.verdict != VERDICTS[2]][:MOST_TRIED] if free else [chosen]
    fastest, best = chosen, list[LineFound]()
    for one in tried:
        if one.verdict == VERDICTS[2]:
            break
        found = lines_for(one, wish, progress=tell)
        if wish.speed is None:
            return order, one, found
        faster = one.with_speed(max((v.speed for v in found if v.speed is not None), default=0.0), wish.speed)
        order = [faster if m is one else m for m in order]
        if not best or faster.margins["speed"] > fastest.margins["speed"]:
            fastest, best = faster, found
        if faster.margins["speed"] >= 0.0:
            break
    run = [m for m in order if m.speed is not None]  # of the others nobody knows whether they are fast enough
    return [*ranked(run), *(m for m in order if m.speed is None)], fastest, best


def _chosen(order: list[Judged], name: str | None) -> Judged:
    if name is None:
        return order[0]
    for one in order:
        if one.muscle.id.lower() == name.lower():
            return one
    raise InputError("muscle", name, f"the candidates are {', '.join(one.muscle.id for one in order)}")
