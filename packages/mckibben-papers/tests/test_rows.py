"""A row is computed, never quoted: change an input, and it moves."""

import pytest

from mckibben_papers import computed, reproduce, rows
from mckibben_papers.rows import PrintedRow, all_rows, decimals_of, judge, reproduce_row, rounds_to


def test_static_rows_and_table_1_hold():
    outcomes = reproduce(
        "I", [r.id for r in all_rows() if r.id.startswith(("static.", "table1.")) and "fit_" not in r.id]
    )
    assert len(outcomes) == 33  # nine static rows and the 24 of Table 1
    assert [o.row.id for o in outcomes if o.ok is False] == []
    told = [o.row.id for o in outcomes if o.ok is None]
    assert told == [
        "static.zero_tension_length",
        "table1.nylon.dynamic_range",
        *(f"table1.fiberglass.{row}" for row in ("stiffness", "stiffness_intensity")),
        "table1.bridgestone.stiffness",
    ]


def test_biology_rows_hold():
    assert [o.row.id for o in reproduce("discussion", ["biology"]) if not o.ok] == []


def test_a_row_moves_with_its_input(monkeypatch):
    row = next(r for r in all_rows() if r.id == "static.max_tension")
    law = computed._nylon()
    before = reproduce_row(row).ours
    monkeypatch.setattr(computed, "_nylon", lambda: law.replace(stiffness_per_pressure=0.5e-2))
    after = reproduce_row(row)
    # dF/dKg = (P' - Pth)(L - Lmin) = 4.097e5 Pa * 5.49 cm = 22.5 N per mm of Kg
    assert after.ours - before == pytest.approx(0.34e-3 * 4.097e5 * 5.49e-2, rel=1e-9)
    assert after.ok is False


def test_every_row_is_listed_even_without_a_verdict(monkeypatch):
    assert any(map(rows.needs_recording, all_rows()))  # what computes is loaded, and has registered itself
    monkeypatch.setattr(rows, "_WAYS", {})
    outcomes = reproduce()
    assert [o.row.id for o in outcomes] == [r.id for r in all_rows()]
    assert all(o.verdict == "to come" and o.ours is None for o in outcomes)


@pytest.mark.parametrize(
    ("ours", "printed", "decimals", "holds"),
    [
        (54.7356, 54.7, 1, True),
        (54.76, 54.7, 1, False),
        (322.17, 322.0, 0, True),
        (322.6, 322.0, 0, False),
        (0.126, 0.13, 2, True),
        (0.1245, 0.13, 2, False),
        (0.206, 0.2, 2, False),
    ],
)
def test_printed_means_rounds_to(ours, printed, decimals, holds):
    row = PrintedRow("a", "I", "", printed, "N", "printed", decimals=2 if printed == 0.2 else None)
    assert decimals_of(row) == decimals
    assert rounds_to(ours, printed, decimals) is judge(row, ours) is holds


def test_verdicts_of_the_other_kinds():
    near = PrintedRow("a", "I", "", 100.0, "N", "near", tolerance=0.01)
    assert judge(near, 100.9) and not judge(near, 101.1)
    inside = PrintedRow("b", "I", "", (0.2, 0.5), "cm", "range")
    assert judge(inside, 0.2) and not judge(inside, 0.51)
    assert judge(PrintedRow("c", "I", "", 1.0, "N", "open"), 5.0) is None
