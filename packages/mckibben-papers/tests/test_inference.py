"""A row that is left out is told by the others alone: exactly where they know it, and not where they do not."""

import numpy as np
import pytest

from mckibben_papers import inference, measured, networks, rows
from mckibben_papers.inference import Network, infer, make_parameter, predict
from mckibben_papers.rows import PrintedRow, all_rows, is_inferred, rows_by_name

SLOPE, END = 3.0, -2.0  # of a line, the inputs of the drawn rows
AT = (0.5, 1.0, 2.0, 4.0)


def drawn(monkeypatch, prints=None, **more):
    """A network of points of a line that two inputs describe, and their printed values."""
    values = {f"line.{x}": SLOPE * x + END for x in AT} | (prints or {})
    drawn_rows = {
        n: PrintedRow(n, "I", "", v, "N", "range" if isinstance(v, tuple) else "near", 0.01, "other rows")
        for n, v in values.items()
    }
    monkeypatch.setattr(rows, "rows_by_name", lambda: drawn_rows)
    monkeypatch.setattr(inference, "rows_by_name", lambda: drawn_rows)
    inputs = {"slope": make_parameter(2.0, 0.0, 10.0, "N/m"), "end": make_parameter(-1.0, -5.0, 5.0, "N")}
    models = {n: (lambda v, x=float(n[5:]): v["slope"] * x + v["end"]) for n in values}
    return Network(inputs, models, **more)


def test_others_that_agree_tell_the_row_and_its_inputs(monkeypatch):
    told = predict(drawn(monkeypatch), "line.2.0")
    assert told.value == pytest.approx(SLOPE * 2.0 + END, rel=1e-6)  # of a linear problem, the margin at the bounds
    assert told.told and told.needed is None and told.by == ("line.0.5", "line.1.0", "line.4.0")
    assert {n: v[0] for n, v in told.inputs.items()} == pytest.approx({"slope": SLOPE, "end": END}, rel=1e-6)
    assert {n: v[3] for n, v in told.inputs.items()} == pytest.approx({"slope": 2.0, "end": 1.0}, rel=1e-9)


def test_a_row_that_is_left_out_moves_nothing_of_its_prediction(monkeypatch):
    prints = ({"line.2.0": 4.0}, {"line.2.0": 400.0})
    one, other = (predict(drawn(monkeypatch, print_), "line.2.0") for print_ in prints)
    assert (one.value, one.spread, one.inputs) == (other.value, other.spread, other.inputs)
    pair = frozenset(("line.2.0", "line.4.0"))
    prints = ({"line.4.0": 10.0}, {"line.4.0": 90.0})
    one, other = (predict(drawn(monkeypatch, print_, together=(pair,)), "line.2.0") for print_ in prints)
    assert (one.value, one.spread, one.by) == (other.value, other.spread, ("line.0.5", "line.1.0"))


def test_the_input_that_would_have_to_change_gives_the_print(monkeypatch):
    network = drawn(monkeypatch, {"line.2.0": 4.4})
    told = predict(network, "line.2.0")
    assert told.told and told.needed is not None and not told.needed.beyond
    inputs = {n: v[0] for n, v in told.inputs.items()} | {told.needed.name: told.needed.value}
    assert network.models["line.2.0"](inputs) == pytest.approx(4.4, rel=1e-6)
    assert predict(drawn(monkeypatch, {"line.2.0": 40.0}), "line.2.0").needed.beyond


def test_what_no_other_row_tells_is_as_wide_as_its_bounds_and_not_told(monkeypatch):
    network = drawn(monkeypatch, silent=frozenset(f"line.{x}" for x in AT))
    alone = predict(network, "line.1.0")
    # even bounds have a standard deviation of their range over sqrt(12); two inputs of a range of 10 add in squares
    assert alone.spread == pytest.approx(10.0 * np.sqrt(2.0 / 12.0), rel=1e-9)
    assert (
        not alone.told
        and alone.by == ()
        and "no other row tells it" in alone.words(rows_by_name()["static.max_tension"])
    )


def test_an_interval_tells_only_that_a_value_lies_in_it(monkeypatch):
    inside = drawn(monkeypatch, {"line.4.0": (5.0, 30.0)})
    assert predict(inside, "line.2.0").value == pytest.approx(SLOPE * 2.0 + END, rel=1e-6)
    outside = drawn(monkeypatch, {"line.0.5": (0.0, 1.0), "line.1.0": (0.0, 10.0), "line.2.0": (0.0, 10.0)})
    x, _, _ = infer(outside, frozenset(("line.4.0",)))
    assert outside.value("line.0.5", x) == pytest.approx(0.0, abs=1e-6)  # drawn to the end, and no further


def test_every_row_that_is_told_has_a_network_whose_inputs_begin_within_their_bounds():
    for row in filter(is_inferred, all_rows()):
        network = networks.network(row.id)
        assert row.id in network.models, row.id
        for name, one in network.inputs.items():
            assert one.low <= one.start <= one.high and one.low < one.high, (row.id, name)
        assert set(network.models) - {networks.OF_ENERGY} <= {r.id for r in all_rows()}


def test_the_sensitivity_of_the_output_to_the_stretched_length_is_what_pulls_there():
    told = predict(networks.network("energy.maximal.output"), "energy.maximal.output")
    *_, slope = told.inputs[networks.STRETCHED]
    # dWa/dL2 = F2max - F2min: 5 bar less the passive end, at 15.5 cm, in J per cm; its own slope of 23 N/cm over a step
    # of 0.02 cm adds a fifth of a per cent
    assert slope == pytest.approx(0.01 * 0.466e-2 * (5e5 - 0.903e5) * (0.155 - 0.0991), rel=0.03)


def test_a_sine_is_recorded_until_it_has_the_amplitude_and_as_long_as_the_others(monkeypatch):
    asked = []

    def recording(name, *, frequency, amplitude, cycles, precondition):
        asked.append(float(amplitude.split()[0]))
        assert cycles / float(frequency.split()[0]) >= measured.SINE_TIME and cycles >= measured.SINE_CYCLES
        return asked[-1]

    class Loop:
        def __init__(self, amplitude):
            self.raw, self.length_low, self.length_high = self, 0.0, 2.0 * 0.14 * 0.9 * amplitude  # a tenth is lost

    monkeypatch.setattr(measured, "recording", recording)
    monkeypatch.setattr(measured, "step_of", lambda record, label: record)
    monkeypatch.setattr(measured, "without_lag", Loop)
    assert measured.recorded_sines(10.0) == asked[-1] == pytest.approx(measured.AMPLITUDE / 0.9, rel=1e-3)
    assert len(asked) == 2
