"""Rows that come from recordings: of the machine where one is enough, of drawn loops where the answer is known."""

import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.errors import ConvergenceError, InputError
from mckibben.muscles.elements import Tendon
from mckibben.recordings import Channel, Recording, read_recording
from mckibben_papers import measured, reproduce, reproduction, rows
from mckibben_papers.rows import ComputedValue, all_rows, computed_row

RECORDED = ("loop.", "friction.", "isometric.", "isotonic.", "static.fit_")
KG, PA, LMIN, FA = 0.466e-2, 0.062e5, 9.91e-2, -16.0  # eq. 13 as printed [m, Pa, m, N]
CORD, TOE, FRAME = 1e5, 5e-4, 1e6
FILTERED = 2.0 * 0.0707 * 2270.0 / (2.0 * np.pi * 200.0)  # height that a lag of 0.8 ms takes at 0.5 L0/s [N]


@pytest.fixture(scope="session")
def triangle():
    """The nylon muscle's loops at 5 bar, recorded on the paper's machine."""
    return measured.triangle()


def drawn(pressure, friction=2.5, low=0.105, high=0.14):
    """Three triangles of a muscle that obeys eq. 13 with Coulomb's friction, in series with cord and frame."""
    law = Tendon(stiffness=CORD, toe_length=TOE)
    time = np.arange(3001) / 1000.0
    up = np.abs((time + 0.5) % 1.0 - 0.5) * 2.0
    length = low + (high - low) * up
    side = np.where(np.gradient(up) > 0.0, friction, -friction)
    tension = np.maximum(KG * (pressure - PA) * (length - LMIN) + FA + side, 0.0)
    stretches = np.linspace(0.0, 3e-3, 30001)
    stretch = np.interp(tension, np.asarray(law.force(jnp.asarray(stretches))), stretches)
    channels = {
        "span": length + stretch + tension / FRAME,
        "tension": tension,
        "pressure": np.full_like(time, pressure),
    }
    units = {"span": "m", "tension": "N", "pressure": "Pa"}
    values = {
        "units.muscle.tendon.stiffness": CORD,
        "units.muscle.tendon.toe_length": TOE,
        "load.frame.stiffness": FRAME,
    }
    meta = {"parameters": {name: {"value": v, "unit": "1"} for name, v in values.items()}}
    return Recording(time, {n: Channel(v, units[n]) for n, v in channels.items()}, meta), length


def test_every_recorded_row_has_a_function():
    wanted = {r.id for r in all_rows() if r.id.startswith(RECORDED)}
    assert len(wanted) == 37 and wanted <= set(rows._WAYS)


def test_the_nylon_loop_is_measured_as_printed(triangle):
    mine = {r.id: computed_row(r) for r in all_rows() if r.id in ("loop.width", "loop.height", "friction.nylon")}
    # a muscle of the printed friction reads less of it, so the height and the friction are predicted with more
    assert [o.ok for o in mine.values()] == [True, False, False]
    assert mine["friction.nylon"].ours == pytest.approx(0.5 * mine["loop.height"].ours, rel=1e-12)
    assert "without the lag" in mine["loop.width"].note


def test_the_lag_of_the_filter_narrows_the_loop_by_what_it_must(triangle):
    both = measured.without_lag(triangle)
    # mid-range is passed at 0.07 m/s both ways; half of it for noise, and for the shift by less than a sample
    assert both.corrected.height - both.raw.height == pytest.approx(FILTERED, abs=0.5 * FILTERED)
    assert both.corrected.width > both.raw.width


def test_the_muscle_itself_holds_its_pressure_within_the_printed_tenth_of_a_bar(triangle):
    assert 0.0 < measured.pressure_variation(triangle).largest < 0.1e5


def test_taking_off_the_stretch_of_cord_and_frame_gives_the_length():
    record, length = drawn(5e5)
    # the table of the cord's force is linear between points 0.1 um apart
    np.testing.assert_allclose(measured.stiff(record)["length"], length, atol=1e-8)


def test_ten_points_of_drawn_loops_give_eq_13_back(monkeypatch):
    monkeypatch.setattr(measured, "triangle", lambda pressure, cycles: drawn(1e5 * float(pressure.split()[0]))[0])
    fit = measured.fit_linear_tension(measured.ten_points("length"))
    assert fit.points == 10
    # friction cancels in the mean of the paths; what remains is the table of the cord
    assert fit.stiffness_per_pressure.value == pytest.approx(KG, rel=1e-4)
    assert fit.offset_pressure.value == pytest.approx(PA, rel=1e-2)
    assert fit.shortest_length.value == pytest.approx(LMIN, rel=1e-4)
    assert fit.offset_tension.value == pytest.approx(FA, rel=1e-3)
    raw = measured.fit_linear_tension(measured.ten_points("span"))
    assert raw.stiffness_per_pressure.value < 0.985 * KG  # a soft machine makes every muscle soft


def test_a_run_that_stops_is_no_result(monkeypatch):
    stopped = Recording(np.arange(2.0), {}, {"result": "stopped", "message": "the tension is too high"})
    monkeypatch.setattr(reproduction, "run", lambda bench, progress: stopped)
    with pytest.raises(ConvergenceError, match="the tension is too high"):
        reproduction.recording("isometric-step", cycles=2)


def test_a_recording_tells_how_far_it_is(monkeypatch):
    heard = []
    done = Recording(np.arange(2.0), {}, {"result": "done"})
    monkeypatch.setattr(reproduction, "run", lambda bench, progress: progress(3.0, 4.0) or done)
    with reproduction.told(heard.append):
        assert reproduction.recording("isometric-step", cycles=1) is done
        assert reproduction.recording("isometric-step", cycles=1) is done  # not made again
    assert heard == ["recording isometric-step, nylon, 1: 0 %", "recording isometric-step, nylon, 1: 75 %"]
    assert not reproduction._tellers
    reproduction.recording.cache_clear()


def test_rises_and_falls_are_taken_apart(monkeypatch):
    known = [
        measured.IsometricTiming(5e-3, 7e-3, 12e-3, t, rising, 1.0, 1.0, settled=True)
        for t, rising in ((30e-3, True), (50e-3, False), (32e-3, True))
    ]
    monkeypatch.setattr(measured, "timings", lambda stroke, **options: known)
    drawn_length = {"muscle.length": np.array([0.14, 0.139])}
    monkeypatch.setattr(measured, "steps", lambda stroke: drawn_length)
    assert measured.rise_full().value == pytest.approx(31e-3)
    assert measured.fall_full().value == pytest.approx(50e-3)
    assert "the braid shortens by 1.00 mm" in measured.rise_full().note


def test_work_and_power_of_a_drawn_shortening(monkeypatch):
    time = np.arange(3000) / 1000.0
    span = 0.13 + 0.01 * np.cos(2.0 * np.pi * time)
    record = Recording(time, {"span": Channel(span, "m"), "tension": Channel(np.full(3000, 10.0), "N")})
    monkeypatch.setattr(measured, "cycles", lambda case, changes: record)
    measured.power.cache_clear()
    try:
        # 10 N over 2 cm, once a second; the derivative over 20 ms loses (pi f w)^2/10 = 4e-4 of the peak
        assert measured.work_light().value == pytest.approx(0.2, rel=1e-3)
        assert measured.mean_power_light() == pytest.approx(0.4, rel=1e-3)
        assert measured.peak_power_light().value == pytest.approx(10.0 * 0.01 * 2.0 * np.pi, rel=1e-3)
    finally:
        measured.power.cache_clear()
    volume = 0.25 * np.pi * 1.1e-2**2 * 0.14
    assert measured.density(14.0) == pytest.approx(14.0 / volume, rel=1e-12)


def test_spread_is_relative_to_the_mean():
    assert measured.spread([0.9, 1.0, 1.1]) == pytest.approx(0.2)


def test_a_note_that_was_found_is_shown_beside_the_row(monkeypatch):
    row = next(r for r in all_rows() if r.id == "friction.lubricated")
    monkeypatch.setitem(
        rows._WAYS, row.id, rows.Computation(lambda: ComputedValue(0.91, "found"), "1", "static", False)
    )
    outcome = computed_row(row)
    assert (outcome.ours, outcome.ok) == (0.91, True)
    assert outcome.note.startswith("static; found; ")


@pytest.mark.slow
def test_all_rows_from_recordings():
    outcomes = {o.row.id: o for o in reproduce(rows=list(RECORDED))}
    assert [o.row.id for o in outcomes.values() if o.ok is False] == []
    # below a tenth of a bar with both accumulators, visibly more without: of the true pressure, for a count is 27 mbar
    bare = reproduction.recording("preconditioning", plumbing="direct", pressure="5 bar", frequency="1 Hz", cycles=4)
    parts = measured.triangle(), reproduction.step_of(bare, "cycles")
    held, free = (measured.variation(p, channel="muscle.pressure", drive="span").largest for p in parts)
    assert free > 1.5 * held
    # history: the falling paths part where the rising ones do not
    (up, down), (small_up, small_down) = (measured.rising_and_falling(s) for s in ("large", "small"))
    apart = measured.path_distance(down, small_down).largest
    assert apart > 5.0 * measured.path_distance(up, small_up).largest
    # what the paper's cell of 100 N could not show is said
    assert "saturated for" in outcomes["friction.bridgestone"].note
    assert measured.treated("WD-40").height < measured.treated("no lubricant").height


def test_the_recordings_of_rows_are_saved_under_the_words_that_say_which_they_are(monkeypatch, tmp_path):
    done = Recording(np.arange(2.0), {}, {"result": "done"})
    monkeypatch.setattr(reproduction, "run", lambda bench, progress: done)
    with reproduction.saved_in(tmp_path / "raw"):
        reproduction.recording("isometric-step", cycles=1, pressure="3 bar")
        reproduction.recording("isometric-step", "fiberglass", cycles=1)
    reproduction.recording("isometric-step", cycles=3)  # outside
    names = [p.name for p in sorted((tmp_path / "raw").iterdir())]
    assert names == ["isometric-step-fiberglass-cycles-1.nc", "isometric-step-nylon-cycles-1-pressure-3-bar.nc"]
    assert np.array_equal(read_recording(tmp_path / "raw" / names[0]).time, done.time)
    with pytest.raises(InputError, match="must be a folder"), reproduction.saved_in(tmp_path / "raw" / names[0]):
        pass
    reproduction.recording.cache_clear()
