"""Characterisation of an unknown muscle: its plan, its bounds, and the whole of it on a simulated rig."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError, StageError
from mckibben.specimens import save_specimen
from mckibben.studies.characterisation.evaluation import (
    CORD_ERROR,
    GAIN_ERROR,
    MOST_GAIN,
    advance,
    clamp_of,
    gain_change,
    half_width,
    leak_of,
    of_muscle,
    rest_volume,
    seat_of,
    with_shared_errors,
)
from mckibben.studies.characterisation.stages import (
    MARGIN,
    Bounds,
    Progression,
    held_out_points,
    planned,
    pressures_of,
    protocol_of,
)
from mckibben.studies.characterisation.verb import plan, recording_folder, settings_of


def test_the_plan_takes_less_than_ten_minutes_of_machine_time():
    for rig in ("paper", "modern"):
        intended = plan(rig, rest_length="14 cm")
        assert 60.0 < intended.total < 600.0
        assert ("leak" in intended.seconds) == intended.bounds.shut_off


def test_no_bound_lies_beyond_the_rig():
    rig = mk.rig("modern")
    bounds = Bounds.of(rig, "direct", rest_length=0.14)
    assert bounds.tension <= MARGIN * float(rig.interlocks.most_tension)
    assert bounds.pressure <= MARGIN * float(rig.interlocks.burst_pressure)
    assert bounds.shortest >= rig.shortest


def test_held_out_points_lie_between_the_pressures_of_the_map():
    bounds = Bounds.of(mk.rig("modern"), "direct", rest_length=0.14, pressure=6e5)
    levels = np.array(pressures_of(6e5))
    for pressure, lengths in held_out_points(bounds, planned(bounds)):
        assert np.abs(levels - pressure).min() > 0.4e5  # half of the distance of two loops is 0.5 bar
        assert all(bounds.shortest < x < bounds.rest_length for x in lengths)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"max_pressure": "12 bar"}, "max_pressure must be above 0 and at most 9 bar, got 12 bar"),
        ({"max_tension": "2 kN"}, "max_tension"),
        ({"rest_length": "3 m"}, "rest_length"),
        ({"plumbing": "none"}, "plumbing"),
        ({"laws": ["nonsense"]}, "nonsense"),
        ({"known": {"wall": "0.5 mm"}}, r"'known\.wall'. The parameters are .*wall_thickness"),
        ({"known": {"rest_length": "0.2 m"}}, r"known\.rest_length is stated as rest_length"),
        ({"known": {"wall_thickness": "5 bar"}}, r"known\.wall_thickness"),
        ({"muscle": None}, "muscle is missing"),
    ],
)
def test_an_argument_out_of_range_is_refused_before_anything_moves(options, said):
    with pytest.raises(InputError, match=said):
        mk.characterise("modern", **{"muscle": "nylon", **options})


def test_a_folder_of_another_characterisation_is_refused(tmp_path):
    (tmp_path / "characterisation.json").write_text(json.dumps({"rig": "paper"}))
    (tmp_path / "1-seat.nc").touch()
    with pytest.raises(InputError, match="its rig is 'paper', not 'modern'; use another folder"):
        mk.characterise("modern", muscle="nylon", out=tmp_path)


def test_a_folder_without_recordings_takes_other_settings_and_one_with_a_changed_muscle_is_refused(tmp_path):
    rig, nylon = mk.rig("modern"), mk.specimen("nylon")

    def settings(pressure, muscle):
        bounds = Bounds.of(rig, "direct", rest_length=0.14, pressure=pressure)
        return settings_of(rig, "direct", bounds, 0, muscle)

    for pressure in (4e5, 5e5):  # with the first nothing was recorded
        recording_folder(tmp_path, settings(pressure, nylon))
    (tmp_path / "1-seat.nc").touch()
    recording_folder(tmp_path, settings(5e5, nylon))
    with pytest.raises(InputError, match="its max_pressure is 5 bar, not 4 bar; use another folder"):
        recording_folder(tmp_path, settings(4e5, nylon))
    changed = dataclasses.replace(
        nylon, laws={"linear_threshold": dict(list(nylon.laws["linear_threshold"].items())[1:])}
    )
    other = mk.muscle(nylon, shortest_length="9 cm")  # of the same specimen, with another law
    for another in (changed, other):
        with pytest.raises(InputError, match="the muscle has changed since its stages were recorded"):
            recording_folder(tmp_path, settings(5e5, another))


def _loops(pressures, *, names, gain=0.0, memory=0.0, noise=0.05):
    """Loops of a spring of 14 cm with friction of 1 N at pressures [Pa], a memory of what was before [N], and the zeros."""
    rng, rate, steps, columns = np.random.default_rng(3), 100.0, [], []
    for pressure, name in zip(pressures, names, strict=True):
        for way, spans in (("shorten", np.linspace(0.14, 0.11, 750)), ("lengthen", np.linspace(0.11, 0.14, 750))):
            friction = 1.0 if way == "lengthen" else -1.0
            columns.append(
                (f"{way} {name}", spans, np.full(750, pressure), 2e-2 * pressure * (spans - 0.105) + friction)
            )
    columns.append(("zero", np.full(150, 0.136), np.zeros(150), np.zeros(150)))
    begin, channels = 0.0, {"span": [], "pressure": [], "tension": []}
    for i, (label, span, pressure, tension) in enumerate(columns, 1):
        end = begin + len(span) / rate
        steps.append(
            {"label": label, "start": begin, "end": end, "recorded": True, "case": {}, "path": f"steps.{i}", "index": i}
        )
        if label != "zero":
            tension = tension + memory * np.exp(-(begin + np.arange(len(span)) / rate) / 10.0)
        channels["span"].append(span)
        channels["pressure"].append(pressure)
        channels["tension"].append((1.0 + gain) * tension + rng.normal(0.0, noise, len(span)))
        begin = end
    units = {"span": "m", "pressure": "Pa", "tension": "N"}
    made = {n: mk.Channel(np.concatenate(v), units[n], "measured") for n, v in channels.items()}
    return mk.Recording(np.arange(len(made["span"].values)) / rate, made, {"steps": steps})


@pytest.mark.parametrize("gain", [0.0, 0.01, -0.01])
def test_a_gain_that_has_changed_is_found_beside_friction_and_a_memory_of_the_stretches_before(gain):
    bounds = plan("modern", rest_length="14 cm").bounds
    known = Progression(top=6e5, largest=420.0, again=3)
    records = {
        "map": _loops((3e5, 4e5), names=("3", "4")),
        "held-out": _loops((3e5,), names=("again",), gain=gain, memory=2.0),  # 1 % of the tension, as much as the gain
    }
    change = gain_change(records, bounds, known)
    # A sixth of what is refused: 10 s lie between the two time constants that are fitted, and the cell has noise.
    assert change.value == pytest.approx(gain, abs=5e-4)
    assert change.low < change.value < change.high < change.value + MOST_GAIN
    assert (change.low > MOST_GAIN or change.high < -MOST_GAIN) == (gain != 0.0)


def test_a_motor_that_does_not_hold_a_slack_muscle_still_is_refused():
    bounds = plan("paper", rest_length="14 cm").bounds

    def seat(swing):
        record = _seat(0.14)
        span = record["span"] + swing * np.sin(20.0 * record.time) * (record.time < 2.0)
        return mk.Recording(record.time, record.channels | {"span": mk.Channel(span, "m", "measured")}, record.meta)

    assert advance("seat", seat(1e-3), bounds, planned(bounds)).zero == pytest.approx(0.0, abs=0.05)  # N, of the noise
    with pytest.raises(StageError, match="stage seat: the span swings by 0.7. cm where it is to stand still"):
        advance("seat", seat(1e-2), bounds, planned(bounds))


def test_the_leak_is_the_share_of_the_pressure_that_is_lost_per_second():
    time = np.arange(0.0, 10.0, 0.01)
    record = mk.Recording(
        time,
        {"pressure": mk.Channel(2e5 * np.exp(-0.004 * time), "Pa", "measured")},
        {
            "steps": [
                {
                    "label": "shut",
                    "start": 0.0,
                    "end": 10.0,
                    "recorded": True,
                    "case": {},
                    "path": "steps.1",
                    "index": 1,
                }
            ]
        },
    )
    assert leak_of(record).value == pytest.approx(0.004, rel=1e-3)  # a line instead of the exponential, over 4 %


def _seat(taut, stiffness=300.0, noise=0.05):
    """The stage in which a vented muscle of 14 cm is pulled longer, which gets taut at a span [m]."""
    time = np.arange(0.0, 12.0, 0.02)
    span = 0.14 * (0.97 + 0.005 * np.clip(time - 2.0, 0.0, 10.0))
    beyond = np.maximum(span - taut, 0.0)
    tension = stiffness * beyond + 0.5 * -np.expm1(-beyond / 3e-4)
    tension += np.random.default_rng(1).normal(0.0, noise, len(time))
    steps = [("zero", 0.0, 2.0), ("pull", 2.0, 12.0)]
    channels = {"span": (span, "m"), "tension": (tension, "N"), "pressure": (np.zeros(len(time)), "Pa")}
    return mk.Recording(
        time,
        {name: mk.Channel(values, unit, "measured") for name, (values, unit) in channels.items()},
        {
            "steps": [
                {"label": n, "start": a, "end": b, "recorded": True, "case": {}, "path": f"steps.{i}", "index": i}
                for i, (n, a, b) in enumerate(steps, 1)
            ]
        },
    )


def _vented(pressure, tension=0.0):
    """The end of the map, where the muscle is vented and slack, with readings of pressure [Pa] and tension [N]."""
    rng, time = np.random.default_rng(1), np.arange(0.0, 1.5, 0.01)
    readings = {"pressure": (pressure, 500.0, "Pa"), "tension": (tension, 0.1, "N")}
    return mk.Recording(
        time,
        {n: mk.Channel(rng.normal(mean, noise, len(time)), u, "measured") for n, (mean, noise, u) in readings.items()},
        {
            "steps": [
                {"label": "zero", "start": 0.0, "end": 1.5, "recorded": True, "case": {}, "path": "steps.1", "index": 1}
            ]
        },
    )


def test_a_zero_that_moves_during_the_map_is_refused_and_what_is_left_of_the_pressure_is_not(bounds):
    known = Progression(zero=0.3, zero_pressure=200.0, top=5e5, largest=80.0)
    for sign in (1.0, -1.0):
        drifted = _vented(200.0 + sign * 20.0 * 200.0)  # the slowest drift of the virtual muscles, for 200 s
        with pytest.raises(
            StageError, match=r"the zero of the pressure sensor has moved by -?0.0\d+ bar, more than 0.3 %"
        ):
            advance("map", drifted, bounds, known)
        with pytest.raises(StageError, match="the zero of the load cell has moved"):
            advance("map", _vented(200.0, 0.3 + sign), bounds, known)
        # 0.1 % of the pressure may be left a while after venting; the next thing that is missing is named then.
        with pytest.raises(StageError, match="no samples of the step 'settle 1'"):
            advance("map", _vented(200.0 + sign * 500.0), bounds, known)


@pytest.fixture(scope="module")
def bounds():
    return Bounds.of(mk.rig("modern"), "direct", rest_length=0.14, pressure=5e5)


def test_the_span_at_which_a_vented_muscle_gets_taut_lies_in_its_interval(bounds):
    for taut in (0.1385, 0.14, 0.1412):
        seat = seat_of(_seat(taut), bounds)
        assert seat.low < taut < seat.high
        assert seat.high - seat.low < 0.01 * 0.14  # the ruler's error; the shape of the onset makes a fifth of it


def test_a_slack_clamp_is_refused_where_the_muscle_gets_taut_beyond_its_rest_length(bounds):
    with pytest.raises(StageError, match=r"stage seat: the vented muscle gets taut at 14\.2\d cm, 1\.\d %"):
        advance("seat", _seat(0.1422), bounds, Progression())
    with pytest.raises(StageError, match="stage seat: the vented muscle is still slack at 14"):
        advance("seat", _seat(0.145), bounds, Progression())
    with pytest.raises(StageError, match="stage seat: the vented muscle gets taut at 13.7.* below"):
        advance("seat", _seat(0.1375), bounds, Progression())
    advance("seat", _seat(0.1408), bounds, Progression())


def test_a_slack_that_the_ruler_does_not_show_is_in_the_interval_of_the_lengths(bounds):
    slack, mounted = 1.5e-3, 0.99 * 0.14  # a ruler that reads 1 % too much hides a slack of 1 %
    low, high = clamp_of(seat_of(_seat(mounted + slack), bounds), bounds)
    assert low < slack < high


def test_the_volume_at_rest_is_that_of_the_ideal_braid_with_these_tensions(bounds):
    law = mk.muscle("nylon", law="ideal").law
    length, pressure = (x.ravel() for x in np.meshgrid(np.linspace(0.11, 0.139, 12), np.linspace(1e5, 5e5, 6)))
    tension = np.array([float(law.tension(x, p)) for x, p in zip(length, pressure, strict=True)])
    volume = rest_volume(mk.ForceMap("ideal", length, pressure, tension), bounds)
    assert volume == pytest.approx(float(law.volume(0.14, 3e5)), rel=0.02)  # of the smoothing below its threshold


def test_an_unknown_muscle_is_moved_by_a_loop_as_fast_as_any_other(bounds):
    from mckibben.bench.prepare import prepare
    from mckibben.bench.rig_file import rig

    for stage in ("seat", "map"):
        protocol = protocol_of(stage, bounds, planned(bounds))
        prepared = prepare(protocol, muscle="nylon", rig="modern", plumbing="direct", foresee=False)
        assert prepared.plan.sample_rate >= float(rig("modern").computer.lowest_motor_rate) and not prepared.findings


def test_the_interval_of_a_prediction_grows_with_the_errors_that_no_fit_has_seen():
    assert half_width(np.full(12, 0.5)) == pytest.approx(
        2.179 * 0.5, rel=1e-3
    )  # Student's t of 12, printed to 4 digits


def test_the_interval_of_a_prediction_allows_for_the_gains_of_two_sensors():
    assert half_width(np.zeros(12), 0.5) == pytest.approx(2.179 * 0.5 * 2.0**0.5, rel=1e-3)  # t is printed to 4 digits


def test_a_span_less_what_the_cord_stretches_is_the_length_of_the_muscle(bounds):
    """The machine's own balance of muscle and cord is the witness."""
    unit = mk.assembly.build.rig_unit("nylon")
    spans, pressure = np.array([0.125, 0.13, 0.139]), 4e5
    lengths = np.array([float(unit.equilibrium(span, pressure).length) for span in spans])
    pulls = np.asarray(unit.tendon.force(spans - lengths))
    readings = {"span": (spans, "m"), "tension": (pulls + 0.7, "N")}
    record = mk.Recording(
        np.arange(3.0), {name: mk.Channel(values, unit, "measured") for name, (values, unit) in readings.items()}, {}
    )
    held = dataclasses.replace(bounds, cord=unit.tendon)
    assert (spans - lengths).min() > 5e-4  # which the cord stretches by
    # the balance is solved to 1 um
    np.testing.assert_allclose(of_muscle(record, held, zero=0.7)["span"], lengths, atol=1e-6)
    assert of_muscle(record, bounds, zero=0.7) is record  # a cord that nobody knows is part of the muscle


def test_intervals_of_parameters_hold_the_truth_beside_errors_that_all_points_share(bounds):
    """Gains, a ruler, a cord and a friction that are off by their standard uncertainties; 4 parameters of 40 muscles."""
    law, chance = mk.muscle("nylon").law, np.random.default_rng(8)
    held = dataclasses.replace(bounds, cord=mk.assembly.build.rig_cord())
    length, pressure = (x.ravel() for x in np.meshgrid(np.linspace(0.11, 0.139, 8), np.linspace(1e5, 5e5, 6)))
    true, inside, blind = np.asarray(law.tension(length, pressure)), [], []
    stretch = np.asarray(held.cord.stretch(true))
    friction = 2e-6 * pressure * (length - 0.125) / 0.015  # as of loops that do not reverse it in full: up to 1 N
    for _ in range(40):
        shown = true * (1.0 + GAIN_ERROR * chance.standard_normal()) + 0.05 * chance.standard_normal(len(true))
        shown = shown + friction * chance.standard_normal()
        read = pressure * (1.0 + GAIN_ERROR * chance.standard_normal())
        points = mk.ForceMap("shown", length + CORD_ERROR * chance.standard_normal() * stretch, read, shown)
        rest = 0.14 * (1.0 + held.rest_length_error * chance.uniform(-1.0, 1.0))
        known = {"rest_length": rest, "upper_length": 0.15, "rest_volume": 5e-6}
        fit = mk.fit(points.with_rest_length(rest), law="linear_threshold", known=known, schemes=())
        one = with_shared_errors(fit, held, GAIN_ERROR, friction[points.taut, None])
        for some, found in ((inside, one), (blind, fit)):
            some += [e.low <= float(getattr(law, name)) <= e.high for name, e in found.parameters.items()]
    # 95 % of 160, of which some four of a muscle go together: two standard errors of 40 draws are 7 %
    assert np.mean(inside) > 0.88
    assert np.mean(blind) < 0.75


def test_a_specimen_file_states_creep_and_leak(tmp_path):
    spec = mk.specimen("nylon")
    numbers = {
        "creep_stiffness": ([100.0, 50.0], "N/m"), "creep_time_constants": ([1.0, 10.0], "s"),
        "leak_decay": (1e-4, "1/s"), "tension_uncertainty": (0.5, "N"),
    }  # fmt: skip
    number = type(spec.properties["rest_length"])
    stated = {name: number(value=value, unit=unit) for name, (value, unit) in numbers.items()}
    save_specimen(dataclasses.replace(spec, properties=spec.properties | stated), tmp_path / "own.toml")
    muscle = mk.muscle(tmp_path / "own.toml")
    assert np.asarray(muscle.creep.stiffness).tolist() == [100.0, 50.0]
    assert np.asarray(muscle.creep.time_constant).tolist() == [1.0, 10.0]
    assert muscle.specimen.property_si("leak_decay", "1/s") == 1e-4
    assert mk.muscle("nylon").creep is None


@pytest.mark.slow
def test_a_muscle_is_characterised_resumed_and_refused_where_it_fails(tmp_path):
    options = {"muscle": "nylon", "max_pressure": "5 bar", "laws": ["linear_threshold"], "out": tmp_path / "nylon"}
    options["known"] = {"threshold_width": "0.8 bar"}

    stages = []
    with pytest.raises(StageError):
        mk.characterise("modern", **options, progress=lambda done, total, stage: stages.append(stage),
                        stop=lambda: "map" in stages)  # fmt: skip
    found = mk.characterise("modern", **options)
    assert [s.resumed for s in found.stages] == [True, True, True, False, False, False]
    assert found.passed and found.seconds < 600.0
    true = mk.muscle("nylon")
    lengths = np.linspace(0.115, 0.135, 5)
    # The cord of the simulated rig, which is known, stretches by 0.8 mm or 4 % of 80 N; gains are known to 0.2 % each.
    assert found.muscle.tension(lengths, 4e5) == pytest.approx(true.tension(lengths, 4e5), abs=0.006 * 80.0)
    assert found.evaluation.fits[0].known["threshold_width"] == pytest.approx(8e4, rel=1e-12)
    assert found.to_dict()["cord"] > 0.0 and not found.to_dict()["assumed"]
    assert float(found.muscle.friction.largest_force(5e5)) == pytest.approx(2.5, rel=0.1)  # relaxation was 3 % of it
    assert mk.muscle(tmp_path / "nylon" / "characterised.toml").tension("12 cm", "4 bar") == pytest.approx(
        found.muscle.tension("12 cm", "4 bar"), rel=1e-9
    )
    assert "Held-out points" in found.report(tmp_path / "report.html").read_text()
    with pytest.raises(StageError, match="stage leak: the shut muscle loses"):
        mk.characterise(mk.rig("modern", {"faults.leak": "1 l/min/bar"}), muscle="nylon", max_pressure="5 bar")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_vents_keeps_the_stages_and_the_same_command_goes_on(tmp_path):
    out = tmp_path / "nylon"
    words = [sys.executable, "-m", "mckibben", "characterise", "--muscle", "nylon", "--rig", "modern"]
    words += ["--max-pressure", "5 bar", "--law", "linear_threshold", "--out", str(out)]
    for begun, done, next_stage in (("1-seat.nc", "seat", "leak"), ("2-leak.nc", "seat, leak", "ramp")):
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while not (out / begun).exists() and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=120.0)
        assert process.returncode == 130, err
        # The stage under way ends at its next sample; a computer that is busy may have begun the one after it.
        assert (
            f"mckibben: interrupted in stage {next_stage}; vented; {done} of 6 stages are in {out}, and the same" in err
        )
        kept = sorted(path.name for path in out.glob("*.nc"))
        assert kept == [name for name in ("1-seat.nc", "2-leak.nc") if name <= begun]


def _strong() -> mk.Muscle:
    """A braid of 30 cm and 4 cm diameter, which pulls with 1.1 kN at 2 bar."""
    return mk.muscle(
        "linear_threshold", stiffness_per_pressure="103.8 mm", shortest_length="186.7 mm", threshold_pressure="0.903 bar",
        threshold_width="0.85 bar", passive_stiffness="1.54 N/mm", rest_length="30 cm", upper_length="30.3 cm",
        rest_volume="272 cm^3",
    )  # fmt: skip


@pytest.mark.slow
def test_the_leak_of_a_muscle_too_strong_for_the_rig_is_measured_at_less_pressure(tmp_path):
    # The interlock of the load cell is at 950 N: filled up to the largest tension, the muscle went on to it by what flowed
    # in meanwhile.
    stages = []
    with pytest.raises(StageError, match="stage ramp"):  # interrupted there
        mk.characterise(
            "modern", muscle=_strong(), out=tmp_path, stop=lambda: "ramp" in stages,
            progress=lambda done, total, stage: stages.append(stage),
        )  # fmt: skip
    leak = mk.read(tmp_path / "2-leak.nc")
    assert leak.meta["result"] == "done" and float(np.max(leak["tension"])) < 950.0


@pytest.mark.slow
def test_a_stage_that_an_interlock_stopped_keeps_its_recording_and_says_what_tension_to_ask_for(tmp_path):
    tender = mk.rig("modern", {"interlocks.most_tension": "20 N"})
    with pytest.raises(StageError, match=r"over force .* largest tension \(max_tension\) of 13 N or less.*Written: "):
        mk.characterise(tender, muscle=_strong(), laws=["linear_threshold"], out=tmp_path)
    (kept,) = tmp_path.glob("failed-*.nc")
    assert float(np.max(mk.read(kept)["tension"])) > 20.0
