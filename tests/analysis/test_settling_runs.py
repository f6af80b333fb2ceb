"""Runs of the library's own: what has not settled runs longer, and what never does says so."""

import copy

import numpy as np
import pytest

from mckibben.quantities import with_unit
from mckibben.web.pages.circuit import diagram
from mckibben.web.pages.circuit.document import starts
from mckibben.web.pages.circuit.state import CircuitState

CIRCUIT = next(iter(starts().values()))  # valve, tube, volume and muscle, for 300 ms


def desk_with(diameter, duration="300 ms"):
    document = copy.deepcopy(CIRCUIT)
    document["elements"]["tube"]["diameter"] = diameter
    document["run"]["duration"] = duration
    desk = CircuitState(document, "tube")
    desk.models = []
    return desk


def test_a_wide_tube_that_still_fills_is_read_from_a_longer_run():
    """5 bar less what the regulator's band and hysteresis leave, 0.05 bar; the same as a run that is long from the start."""
    short, long = desk_with("6 mm"), desk_with("6 mm", "2.4 s")
    first = short.quick()
    assert first.record["muscle.pressure"][-1] == pytest.approx(
        4.85e5, abs=500.0
    )  # where the trace is when the run ends
    answers = short.quick(True), long.quick(True)
    found, whole = (answer.numbers for answer in answers)
    assert found.settled and found.after == pytest.approx(5e5, abs=5e3)
    assert (found.after, found.transition, found.delay) == pytest.approx((whole.after, whole.transition, whole.delay))
    said, whole_said = (diagram.pressure_chart(*one).summary for one in zip((short, long), answers, strict=True))
    assert said.endswith(f"it settles at {with_unit(found.after, 'Pa')}")
    assert whole_said.endswith(f"it ends at {with_unit(whole.after, 'Pa')}")


def test_the_rise_over_the_length_of_a_tube_is_to_the_settled_pressure():
    """A longer tube fills later, by its volume; each length is read to the same end, within a sample of 1 ms."""
    short, long = desk_with("6 mm"), desk_with("6 mm", "2.4 s")
    swept, whole = short.sweep(), long.sweep()
    assert swept.rises == pytest.approx(whole.rises, abs=1e-3)
    assert (np.diff(swept.rises) > 0.0).all()


@pytest.mark.slow  # 64 times the run
def test_what_does_not_settle_in_64_times_its_run_says_so_and_has_no_rise():
    narrow = desk_with("0.3 mm")
    answer = narrow.quick(True)
    found = answer.numbers
    assert not found.settled and found.duration == pytest.approx(64 * 0.3)
    assert diagram.pressure_chart(narrow, answer).summary.endswith("it has not settled")
    assert np.isnan(narrow.sweep().rises[-1])
