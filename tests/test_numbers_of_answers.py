"""What an answer writes, shows and says are the numbers that it holds: answers made by hand, without what computes them."""

import dataclasses
import math
import re

import numpy as np
import pytest

from mckibben.analysis.channels import Interval
from mckibben.analysis.frequency import ChannelResponse, FrequencyResponse
from mckibben.analysis.lever import ContractionTiming, LeverLoop, LeverProtocol, TensionShare
from mckibben.analysis.lever_answers import Contraction, WorkLoops, cautions_of_contraction
from mckibben.analysis.repeatability import CourseRepeatability, Repeatability, Spread
from mckibben.answers import Caution
from mckibben.errors import InputError
from mckibben.estimation import Estimate
from mckibben.identification.circuit_fit import ChannelError, CircuitFit
from mckibben.identification.constraints import ConstrainedFit
from mckibben.simulation.fit import FieldError, SimulationFit
from mckibben.simulation.linear import SampledModel


def numbers(words):
    return [float(n) for n in re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?", words)]


TWITCH = LeverProtocol("twitch", 0.1, 2e-4, None, 1, None, None, None)
TIMING = ContractionTiming(
    0.1, 0.01, 0.15, 0.41, "rest", (TensionShare(0.1, 0.11, 0.05),),
    (TensionShare(0.5, 0.2, 0.21), TensionShare(0.1, math.nan, 0.05)),
)  # fmt: skip


def test_a_contraction_is_its_points_in_their_order_and_after_the_stimulus():
    one = Contraction("a.ddf", TIMING, TWITCH, (), "Chosen by name: the force is tension.")
    said = one.to_dict()
    assert (said["time_to_peak"], said["developed_force"]) == pytest.approx((0.05, 0.4), rel=1e-12)
    assert said["peak_force"] == 0.41 and said["file"] == "a.ddf" and said["protocol"] == TWITCH._asdict()
    assert said["rising"] == [{"share": 0.1, "time": 0.11, "force": 0.05}] and len(said["relaxing"]) == 2
    assert dataclasses.replace(one, protocol=None).to_dict()["protocol"] is None
    assert TIMING._replace(above="zero").developed_force == 0.41
    rows = one.tables()[0].rows
    names = ["stimulus", "rising 10 %", "peak", "relaxing 50 %", "relaxing 10 %, below rest"]
    assert [row["point"] for row in rows] == names
    assert [row["after"] for row in rows][:4] == pytest.approx([0.0, 0.01, 0.05, 0.1], abs=1e-12)
    assert [row["force"] for row in rows] == [0.01, 0.05, 0.41, 0.21, 0.05]
    peak, chosen = one.remarks()
    assert numbers(peak) == pytest.approx([410.0, 400.0, 50.0], rel=1e-3) and chosen == one.guessed  # as printed
    assert dataclasses.replace(one, guessed="").remarks() == [peak]


@pytest.mark.parametrize(("kind", "count"), [("twitch", 0), ("tetanus", 0), ("work loop", 1)])
def test_only_a_protocol_of_work_loops_is_said_beside_a_contraction(kind, count):
    assert len(cautions_of_contraction(TWITCH._replace(kind=kind))) == count
    assert cautions_of_contraction(None) == ()


def test_work_loops_are_told_with_their_beginnings_and_their_mean():
    loops = (LeverLoop(1, 0, 100, 2e-3, 0.1, 0.02, 0.021), LeverLoop(3, 200, 300, 4e-3, 0.2, 0.03, 0.035))
    one = WorkLoops("a.ddf", "L0", loops, (0.0, 0.2), TWITCH, (), "")
    assert one.mean == pytest.approx({"work": 3e-3, "power": 0.025, "mean_power": 0.028}, rel=1e-12)
    assert one.to_dict()["cycles"] == one.rows() == [loop._asdict() for loop in loops]
    assert (one.to_dict()["cut"], one.to_dict()["mean"]) == ("L0", one.mean)
    assert one.to_dict()["protocol"] == TWITCH._asdict()
    assert [(row["cycle"], row["from"]) for row in one.tables()[0].rows] == [(1, 0.0), (3, 0.2)]
    assert numbers(one.remarks()[0]) == pytest.approx([3.0, 25.0, 28.0], rel=1e-4)
    assert len(one.remarks()) == 1 and len(dataclasses.replace(one, guessed="so").remarks()) == 2


def test_a_repeatability_is_its_distances_peaks_and_drift():
    courses = np.array([[1.0, 5.0], [2.0, 6.0], [3.0, 9.0]])
    of = Repeatability(0.5, 2.0, 0.125, 3, np.array([0.0, 0.5]), courses)
    one = CourseRepeatability(
        ("a.nc",),
        "A",
        "force",
        "N",
        "cycle",
        of,
        Spread(6.5, 1.5, 4.0, 0.6),
        Interval(2.0, 1.0, 3.0),
        (),
        {"drive": "span"},
    )
    assert one.rows() == [{"cycle": 1, "peak": 5.0}, {"cycle": 2, "peak": 6.0}, {"cycle": 3, "peak": 9.0}]
    said = one.to_dict()
    assert (said["between"], said["repetitions"], said["rms"], said["largest"]) == ("cycles", 3, 0.5, 2.0)
    assert said["relative_rms"] == 0.125 and said["drift"] == {"value": 2.0, "low": 1.0, "high": 3.0}
    assert said["peaks"]["mean"] == 6.5 and said["peaks"]["values"].tolist() == [5.0, 6.0, 9.0]
    shown = {row["name"]: (row["value"], row["remark"]) for row in one.tables()[0].rows}
    assert shown == {
        "rms distance from the mean course": ("0.5 N", "12.5 % of its range"),
        "largest distance": ("2 N", ""),
        "peak": ("6.5 N", "standard deviation 1.5 N"),
        "drift of the peak per cycle": ("2 N", "95 %: 1 N to 3 N"),
    }
    assert one.remarks() == ["Chosen by name and unit: {drive} names another channel than span."]
    bare = dataclasses.replace(one, drift=None, guessed={})
    assert bare.to_dict()["drift"] is None and len(bare.tables()[0].rows) == 3 and bare.remarks() == []


def test_a_response_is_shown_at_its_ends_and_falls_where_its_magnitude_does():
    frequency = np.geomspace(1.0, 100.0, 41)
    lag = FrequencyResponse(
        frequency, 1.0 / np.hypot(1.0, frequency / 10.0), -np.arctan(frequency / 10.0), np.ones(41), 4
    )
    one = ChannelResponse("a.nc", "A", "valve", "pressure", "Pa", lag, True, (), (9.0, 11.0, math.nan), ("source",))
    # between points the magnitude is straight over logarithms; there are 20 a decade
    assert lag.cutoff(1.0) == pytest.approx(10.0, rel=2e-3)
    assert lag.cutoff() == pytest.approx(10.0 * math.sqrt(2.0 * 1.01 - 1.0), rel=2e-3)  # from that at 1 Hz
    assert math.isnan(lag.cutoff(2.0)) and math.isnan(lag._replace(magnitude=np.ones(41)).cutoff())
    said = one.to_dict()
    assert (said["input"], said["output"], said["unit"], said["segments"]) == ("valve", "pressure", "Pa", 4)
    assert said["cutoff"] == lag.cutoff() and said["run_cutoffs"][:2] == [9.0, 11.0]
    assert "run_cutoffs" not in dataclasses.replace(one, cutoffs=(9.0,)).to_dict()
    rows = one.tables()[0].rows
    assert (rows[0]["frequency"], rows[-1]["frequency"]) == (1.0, frequency[-1])
    assert [row["phase"] for row in rows] == [lag.phase[list(frequency).index(row["frequency"])] for row in rows]
    assert one.column_units() == {"frequency": "Hz", "magnitude": "Pa", "phase": "rad"}
    first, runs, chosen = one.remarks()
    assert numbers(first) == pytest.approx([41.0, 4.0, 3.0, lag.cutoff()], rel=1e-3)
    assert numbers(runs) == [3.0, 3.0, 9.0, 11.0] and chosen.startswith("Chosen by name and unit: {source}")
    alone = dataclasses.replace(one, cutoffs=(9.0,), guessed=(), averaged=False)
    assert len(alone.remarks()) == 1 and "segments" not in alone.remarks()[0]


E = Estimate(4.0, 3.8, 4.2, "N")


def test_a_fit_of_a_circuit_writes_the_errors_of_what_was_fitted_and_of_what_was_predicted():
    errors = (
        ChannelError("runs/a.nc", "tank.pressure_abs", True, 3.0, 7.0, 1e-3),
        ChannelError("runs/b.nc", "tank.pressure_abs", True, 4.0, 8.0, None),
        ChannelError("runs/c.nc", "port.pressure_abs", False, 5.0, 9.0, -1e-3),
    )
    paths = {"c": ("elements.a.conductance", "elements.b.conductance")}
    one = CircuitFit({"c": E}, paths, errors, {}, np.eye(1), True, "ended", 12, ("a word",))
    assert one.changes == {"elements.a.conductance": 4.0, "elements.b.conductance": 4.0}
    said = one.to_dict()
    assert said["parameters"] == {"c": E._asdict()} and said["errors"] == [e._asdict() for e in errors]
    assert said["rms"] == {"fitted": pytest.approx(math.sqrt(12.5), rel=1e-12), "predicted": 5.0}
    assert (said["converged"], said["message"], said["evaluations"], said["warnings"]) == (
        True,
        "ended",
        12,
        ["a word"],
    )
    assert one.rms(channel="port.pressure_abs", fitted=False) == 5.0 and math.isnan(
        one.rms(channel="port.pressure_abs")
    )
    table = one.tables("Tube")[1]
    keys = ("record", "channel", "used", "rms", "lead")
    assert [tuple(row[key] for key in keys) for row in table.rows] == [
        ("a.nc", "tank", "fitted", 3.0, 1e-3), ("b.nc", "tank", "fitted", 4.0, None),
        ("c.nc", "port", "predicted", 5.0, -1e-3),
    ]  # fmt: skip
    assert table.notes == ("note: a word",)
    failed = dataclasses.replace(one, converged=False)
    assert failed.tables("Tube")[1].notes[0] == "The search did not converge: ended."


def test_a_fit_of_a_simulation_writes_and_shows_its_parameters_and_errors():
    errors = (FieldError("span", "m", True, 40, 1e-3, 2e-3), FieldError("span", "m", False, 20, 3e-3, 4e-3))
    one = SimulationFit({"k": E}, None, errors, np.eye(1), True, "ended", 7, (Caution("so", "k"),))
    assert one.to_dict() == {
        "parameters": {"k": E._asdict()}, "errors": [e._asdict() for e in errors], "correlation": [[1.0]],
        "converged": True, "message": "ended", "evaluations": 7,
    }  # fmt: skip
    assert one.rows() == [{"name": "k", **E._asdict()}]
    assert (one.rms("span"), one.rms("span", shown=False)) == (1e-3, 3e-3)
    assert math.isnan(dataclasses.replace(one, errors=errors[:1]).rms("span", shown=False))
    with pytest.raises(InputError, match="Known are span"):
        one.rms("force")
    parameters, table = one.tables()
    assert [row["used"] for row in table.rows] == ["fitted", "not shown"] and table.notes == ()
    assert parameters.rows[0]["value"] == 4.0
    assert dataclasses.replace(one, converged=False).tables()[1].notes == ("The search did not converge: ended.",)


def test_constraints_that_leave_a_parameter_open_say_so_in_its_place():
    found = {"k": E, "x": Estimate(1.0, 1.0, 1.0, "m")}
    one = ConstrainedFit("ideal", found, {"rest_length": 0.14}, 3, (Caution("x is open", "x"),))
    assert one.to_dict() == {
        "fits": [
            {
                "law": "ideal", "parameters": {n: e._asdict() for n, e in found.items()}, "known": {"rest_length": 0.14},
                "n": 3, "warnings": ["x is open"],
            }
        ]
    }  # fmt: skip
    assert one.rows() == [{"parameter": n} | e._asdict() for n, e in found.items()]
    assert {row["name"]: row["said"] for row in one.tables()[0].rows} == {"k": "not determined", "x": ""}


def test_a_sampled_model_has_the_modes_of_its_matrix_and_the_gain_of_a_lag():
    period, rate = 1e-2, 5.0
    keep = math.exp(-rate * period)
    one = SampledModel(
        np.array([[keep]]), np.array([[1.0 - keep]]), np.array([[2.0]]), np.zeros((1, 1)), period, ("x",), ("u",), ("y",),
        {"u": "Pa", "y": "N"}, {"u": 1e5}, {"y": 20.0}, {"u": 1e3}, "held", (),
    )  # fmt: skip
    assert one.poles == pytest.approx([-rate], rel=1e-9)
    slow = one.response("u", "y", 1e-3)[0]
    assert slow == pytest.approx(2.0, rel=2e-3)  # far below the corner of 0.8 Hz
    assert abs(one.response("u", "y", rate / (2.0 * math.pi))[0]) == pytest.approx(math.sqrt(2.0), rel=2e-2)
    said = one.to_dict()
    assert (said["A"], said["C"], said["period"]) == ([[keep]], [[2.0]], period)
    assert (said["commands"], said["values"], said["amplitudes"]) == ({"u": 1e5}, {"y": 20.0}, {"u": 1e3})
    assert np.array(said["poles"]).ravel() == pytest.approx([-rate, 0.0], abs=1e-9)
    assert one.tables()[0].rows == one.rows() and one.rows()[0]["frequency"] == pytest.approx(
        rate / (2.0 * math.pi), rel=1e-9
    )
    assert "at an amplitude of 1 kPa of u" in one.remarks()[0] or "0.01 bar of u" in one.remarks()[0]
    assert "constant forces" in one.remarks()[0]
    assert "springs" in dataclasses.replace(one, friction="stuck").remarks()[0]
    for frequency in (0.0, 50.1):
        with pytest.raises(InputError, match="must be above 0 Hz and up to 50 Hz"):
            one.response("u", "y", frequency)
    assert one.response("u", "y", 50.0).shape == (1,)
