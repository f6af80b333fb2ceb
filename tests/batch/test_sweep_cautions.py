"""Every value of a sweep that can hardly be meant is said, from the ends of what is varied inwards."""

from types import SimpleNamespace

import numpy as np

from mckibben.batch.lanes import LOOKED, LanePlanner
from mckibben.batch.variants import Variants


def said(variants, caution):
    """Cautions by row, of benches that say what a function of their row does; and how many benches were built."""
    built = []

    def bench(row):
        built.append(row)
        return SimpleNamespace(cautions=caution(row))

    return LanePlanner.cautions(SimpleNamespace(factory=SimpleNamespace(bench=bench)), variants), len(built)


def test_slips_between_the_ends_of_a_range_are_said():
    """Of ``0.1..3e5`` Pa, also where no variant has an end of the range, as in a hypercube."""
    for values in (np.geomspace(0.1, 3e5, 8), np.geomspace(0.1, 3e5, 8)[::-1], np.geomspace(0.13, 2.9e5, 8)):
        found, _ = said(Variants({"high": values}), lambda row: (f"{row['high']:g} Pa",) if row["high"] < 2e3 else ())
        assert {*found} == {*np.flatnonzero(values < 2e3)}


def test_what_is_said_of_all_variants_is_said_of_those_at_the_ends():
    values = np.linspace(1e5, 3e5, 1000)
    found, built = said(Variants({"high": values}), lambda _: ("the law may be off",))
    assert {*found} == {0, 999} and built == 2


def test_of_a_range_that_is_a_slip_as_a_whole_so_many_are_looked_at():
    found, built = said(Variants({"high": np.linspace(1.0, 3.0, 1000)}), lambda row: (f"{row['high']:g} Pa",))
    assert len(found) == built == 2 * LOOKED
