"""The figures of the paper of 1994, a choice of the longer paper's: the same functions under its numbers."""

from __future__ import annotations

from .entries import (
    CONFERENCE,
    FIBERGLASS_ROWS,
    FIT,
    FIT_ROWS,
    GEOMETRY,
    INFERRED_LAW,
    LOOPS,
    MACHINE,
    MODEL,
    MODEL_ROWS,
    SINE_ROWS,
    SINES,
    TABLE,
    PaperFigure,
    later,
    table_rows,
)


def second_paper() -> tuple[PaperFigure, ...]:
    """Its figures."""

    def one(
        key: str, title: str, caption: str, rows: tuple[str, ...], at: tuple[str, str], *, recordings: bool = False,
        part: str = "I",
    ) -> PaperFigure:  # fmt: skip
        name = f"1994-{key}"
        return PaperFigure(name, CONFERENCE, part, title, caption, rows, later(*at, name), recordings)

    loops = ("loop.width", "loop.height", "loop.small_range_ratio", "loop.rising_path_distance", "loop.rate_ratio")
    return (
        one("1", "Geometry of the muscle", GEOMETRY, (), ("machine", "geometry")),
        one("2", "Dynamic testing machine", MACHINE, (), ("machine", "machine")),
        one(
            "3a", "Quasi-static loops, nylon, both ranges", LOOPS + " Dashed is the large range, full the small one.",
            loops, ("loops", "both_ranges"), recordings=True,
        ),
        one(
            "3b", "Quasi-static loops, fiberglass", LOOPS + INFERRED_LAW, FIBERGLASS_ROWS, ("loops", "figure_3c"),
            recordings=True,
        ),
        one("4", "Dynamic loops of sines", SINES, SINE_ROWS, ("loops", "figure_4"), recordings=True),
        one("5a", "Linear static model", MODEL, MODEL_ROWS, ("statics", "figure_6a")),
        one("5b", "Eq. 13 through ten points", FIT, FIT_ROWS, ("statics", "figure_6b"), recordings=True),
        one(
            "table1", "McKibben and biological muscles", TABLE, table_rows(), ("table", "table"), recordings=True,
            part="discussion",
        ),
    )  # fmt: skip
