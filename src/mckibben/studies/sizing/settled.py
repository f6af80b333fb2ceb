"""Muscles held behind a valve until their tension has settled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from .circuit import Course, Lane, courses

LONGER = (4.0, 16.0)  # times a lane's time constants of filling, for a tension that has not settled by then


def settled_courses(lanes: Sequence[Lane], done: Sequence[Course]) -> list[Course]:
    """Courses of held muscles of which the tension settles before the turn.

    Args:
        lanes: of the courses.
        done: their courses; those that have settled are taken as they are, the others run again for longer.

    Returns:
        The courses; one that has not settled even then says so.
    """
    found = list(done)
    for times in LONGER:
        late = [i for i, course in enumerate(found) if course.sound and not course.settled]
        if not late:
            break
        again = courses([replace(lanes[i], fills=times * lanes[i].fills) for i in late])
        for i, course in zip(late, again, strict=True):
            found[i] = course if course.sound else found[i]
    return found
