"""Verdicts are counted by kind: what is open, untold or wide is never hidden in one word."""

import re
from collections import Counter
from pathlib import Path

import pytest

from mckibben_papers import PrintedRow, RowOutcome, reproduce
from mckibben_papers.inference import RowPrediction
from mckibben_papers.rows import (
    BASES,
    KINDS,
    accepted_band,
    all_rows,
    decimals_of,
    headline,
    is_prediction,
    judge,
    kind_of,
    said_of,
    tallies,
)


def outcome(ours: float | None, expect: str = "near", paper=2.0, **more) -> RowOutcome:
    row = PrintedRow("a", "I", "", paper, "N", expect, **{"tolerance": 0.2, **more})
    return RowOutcome(row, ours, None if ours is None else judge(row, ours), "")


def told(ours: float, *, told: bool = True, **more) -> RowOutcome:
    """A row that all others predict, and whether they tell it."""
    one = outcome(ours, basis="other rows", **more)
    return one._replace(prediction=RowPrediction(ours, 0.1, told, ("b",), {}, None), ok=(told and one.ok) or None)


ALL = [
    outcome(2.24), outcome(1.9), outcome(2.5, "range", (1.0, 3.0)), told(2.02), told(1.98, expect="near"),
    told(3.5), told(2.01, told=False), outcome(20.0, "erratum"), outcome(1.0, "synthetic"),
]  # fmt: skip


def test_the_headline_counts_every_kind_apart_with_its_differences():
    assert headline(ALL) == (
        "9 printed numbers: 2 are predicted (\N{MINUS SIGN}1 to +1 %), 3 are arithmetic (\N{MINUS SIGN}5 to +12 %), "
        "1 is synthetic (\N{MINUS SIGN}50 %), 2 are open (0 to +75 %) of which the others do not tell 1, "
        "1 is a misprint, none falls short."
    )


def test_the_headline_names_what_falls_short_and_what_is_to_come():
    found = headline([outcome(2.9), outcome(None), outcome(None)])
    assert found == "3 printed numbers: 1 falls short (+45 %), 2 are to come."
    assert headline([outcome(None)]) == "1 printed number: 1 is to come."
    assert headline([]) == "No printed number was asked for."


def test_every_outcome_is_of_one_kind_and_kinds_have_names_of_their_own():
    assert sum(t.rows for t in tallies(ALL)) == len(ALL)
    assert all(KINDS[o.verdict] is kind_of(o) for o in ALL)
    assert len({k.key for k in KINDS.values()}) == len(KINDS)


def test_a_number_inside_its_interval_differs_by_nothing():
    (one,) = tallies([outcome(1.01, "range", (1.0, 3.0))])
    assert (one.lowest, one.highest) == (0.0, 0.0)
    (one,) = tallies([outcome(3.3, "range", (1.0, 3.0))])
    assert one.kind.key == "short" and one.highest == pytest.approx(0.1)


@pytest.mark.parametrize("row", all_rows(), ids=lambda row: row.id)
def test_a_tolerance_wider_than_the_print_has_its_reason(row):
    accepted = accepted_band(row)
    if accepted is not None and (row.expect == "range" or accepted[1] > printed_half(row)):
        assert len(row.reason) > 20, f"{row.id}: a tolerance wider than printed, without a reason"
    else:
        assert not row.reason, f"{row.id}: a reason without a tolerance of its own"
    assert row.reason in said_of(row)


def printed_half(row: PrintedRow) -> float:
    """Half a unit of the last printed digit."""
    return 0.5 * 10.0 ** -decimals_of(row) * (1.0 + 1e-9)


@pytest.mark.parametrize("row", all_rows(), ids=lambda row: row.id)
def test_a_row_says_what_went_in(row):
    assert row.basis in BASES and len(row.inputs) > 20
    assert row.inputs in said_of(row)
    assert row.expect != "open" or row.repeats or len(row.note) > 20, "open for no reason"


def test_a_row_that_names_other_rows_names_rows_that_exist():
    ids = {r.id for r in all_rows()}
    for row in all_rows():
        for word in re.findall(r"(?:static|loop|friction|table1|tube|isometric|isotonic|energy)\.[\w.]*\w", row.inputs):
            assert word in ids and word != row.id, f"{row.id}: {word}"


def test_a_zero_that_ends_a_printed_number_counts():
    rows = {r.id: r for r in all_rows()}
    efficiency = rows["energy.valve.efficiency"]  # printed 0.20
    assert judge(efficiency, 0.1973) and not judge(efficiency, 0.206)
    density = rows["biology.peak_power_density"]  # printed 0.70
    assert judge(density, 0.7) and not judge(density, 0.71)


def stated() -> str:
    """The headline that the README states."""
    text = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")
    found = re.search(r"^> (\d+ printed numbers: .*\.)$", text, flags=re.M)
    assert found is not None
    return found[1]


def test_the_readme_counts_the_rows_as_they_are():
    """By what their print alone says of them; which predictions are open shows when they are computed."""
    kinds = {"erratum": "misprint", "synthetic": "synthetic"}
    again, silent = (sum(map(bool, map(test, all_rows()))) for test in (lambda r: r.repeats, lambda r: not r.printed))
    rows = [r for r in all_rows() if r.printed and not r.repeats]
    counts = Counter(kinds.get(r.expect) or KINDS[BASES[r.basis]].key for r in rows)
    said = {words: int(number) for number, words in re.findall(r"(\d+) ((?:printed|are|rows) \w+)", stated())}
    assert said["are predicted"] + said["are open"] == counts["predicted"] == sum(map(is_prediction, all_rows()))
    assert (said["are arithmetic"], said["are synthetic"]) == (counts["arithmetic"], counts["synthetic"])
    assert (said["printed numbers"], said["are misprints"]) == (len(rows), counts["misprint"])
    assert (said["rows tell"], said["rows have"]) == (again, silent) and "none falls short" in stated()


@pytest.mark.slow
def test_the_readme_states_the_headline_of_the_reproduction():
    assert stated() == headline(reproduce())


def test_a_number_that_is_told_again_or_has_no_printed_value_is_not_counted():
    rows = [
        outcome(2.0, basis="prediction"), outcome(2.0, basis="prediction", repeats="b"),
        outcome(1.0, "range", (0.0, 1.5), basis="prediction", printed=False),
        outcome(1.6, "range", (0.0, 1.5), printed=False),
    ]  # fmt: skip
    assert headline(rows) == (
        "1 printed number: 1 is predicted (0 %), none falls short; beside them 1 row tells one of them again and "
        "2 rows have no printed value, of which 1 lies outside what we take its words to mean."
    )


def test_what_repeats_a_row_names_one_that_stands_for_itself():
    rows = {r.id: r for r in all_rows()}
    for row in rows.values():
        assert not row.repeats or not rows[row.repeats].repeats, row.id
        assert row.printed or "printed" in row.reason + row.note, f"{row.id}: unprinted, and nothing says so"


@pytest.mark.parametrize(
    ("row", "ours"),
    [
        ("loop.peak_velocity", 1.998),  # 2 pi 10 Hz x 0.0318 L0, as Fig. 4 prints
        ("tube.flow_work_sign", -1.0),
        ("isotonic.frequency_50N", 5.0),  # 14 W / (2 x 1.4 J)
        ("isotonic.printed_peak_power_density", 2.480),  # 33 W / (0.95 cm2 x 14 cm)
        ("energy.atmosphere", 1.01325),
        ("energy.maximal.compression", 5.293),  # P_h V_1 (ln(P_h/P_0) - 1 + P_0/P_h), the closed form of eq. 34
    ],
)
def test_a_misprint_has_its_row_with_the_corrected_value(row, ours):
    (one,) = reproduce(rows=[row])
    # eq. 34 has a limit misprinted, and no number; its row is shown and not counted
    assert one.verdict == ("misprint" if one.row.printed else "not printed") and one.row.expect == "erratum"
    assert one.ours == pytest.approx(ours, rel=3e-4)
