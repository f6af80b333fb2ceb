"""Pictures of recordings: what shares axes, colours and kinds of line, gaps that stay open, and extremes that survive."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from machine_records import machine_record
from mckibben.analysis.segments import segments
from mckibben.errors import InputError
from mckibben.recordings import Channel, Recording
from mckibben.report.figures import style
from mckibben.report.figures.recording_figures import (
    against_figure,
    envelope,
    panels,
    path,
    time_figure,
    told_apart,
    usual_channels,
)

RECORD = machine_record(pressure=["1 bar", "3 bar", "5 bar"])


def axes(fig: Figure) -> dict:
    return {ax.get_ylabel(): ax for ax in fig.axes if ax.get_ylabel()}


def lines(fig: Figure) -> dict:
    return {line.get_label(): line for ax in fig.axes for line in ax.get_lines()}


def test_each_quantity_has_axes_of_its_own_in_its_colour() -> None:
    found = axes(time_figure(RECORD))
    assert list(found) == ["Pressure, bar", "Tension, N", "Span, cm", "Valve, %"]
    for title, quantity in zip(found, ("pressure", "tension", "length", "valve"), strict=True):
        assert found[title].yaxis.label.get_color() == style.COLOURS[quantity]
        assert {line.get_color() for line in found[title].get_lines()} == {style.COLOURS[quantity]}
    assert len({ax.get_xlim() for ax in found.values()}) == 1  # one time


def test_an_absolute_pressure_does_not_stand_on_the_axes_of_a_gauge_pressure() -> None:
    time = np.arange(3.0)
    record = Recording(time, {n: Channel(time + 1e5, "Pa") for n in ("a.pressure", "a.pressure_abs")})
    assert [p.heading for p in panels(record, record.names())] == ["Pressure, bar", "Absolute pressure, bar"]


def test_measured_true_and_command_are_three_kinds_of_line() -> None:
    found = lines(time_figure([RECORD]))
    measured, true, command = (found[n] for n in ("span", "muscle span, true", "command span"))
    assert measured.get_linestyle() == true.get_linestyle() == "-"
    assert command.get_linestyle() == "--"
    assert true.get_linewidth() < measured.get_linewidth()


def test_a_command_that_is_never_in_force_is_not_drawn() -> None:
    assert "command.tension" not in usual_channels([RECORD])
    with pytest.raises(InputError, match="must be a channel with values"):
        time_figure([RECORD], channels=["tension", "command.tension"])


def test_values_are_drawn_in_the_unit_that_the_axes_state() -> None:
    line = lines(time_figure([RECORD], channels=["muscle.pressure"]))["muscle pressure, true"]
    assert np.nanmax(line.get_ydata()) == pytest.approx(RECORD["muscle.pressure"].max() / 1e5, rel=1e-12)  # rounding


def test_what_was_not_recorded_is_not_bridged() -> None:
    line = lines(time_figure([RECORD], channels=["span"]))["span"]
    drawn = np.isnan(line.get_ydata())
    assert drawn.sum() == 2  # two gaps between three recorded steps
    t = np.asarray(line.get_xdata())
    alone = ~drawn[1:] & ~drawn[:-1]
    assert np.diff(t)[alone].max() < 1.5 * RECORD.period


def test_an_envelope_keeps_every_extreme_and_the_ends() -> None:
    rng = np.random.default_rng(0)
    time = np.arange(200_000) * 1e-3
    values = rng.standard_normal(time.size)
    values[123_456] = 50.0  # one sample of a peak
    t, v = envelope(time, values, columns=500)
    assert len(t) <= 4 * 501
    assert (v.max(), v.min()) == (50.0, values.min())
    assert (t[0], t[-1]) == (time[0], time[-1])
    assert np.all(np.diff(t) > 0.0)
    # in every column the line reaches as far as all the samples do
    column = np.minimum((time / time[-1] * 500).astype(int), 499)
    drawn = np.minimum((t / time[-1] * 500).astype(int), 499)
    for i in range(0, 500, 17):
        assert v[drawn == i].max() == values[column == i].max()
        assert v[drawn == i].min() == values[column == i].min()


def test_an_envelope_of_many_samples_leaves_gaps_and_unknown_values_open() -> None:
    time = np.concatenate([np.arange(50_000), 60_000 + np.arange(50_000)]) * 1e-3
    values = np.sin(time)
    values[20_000:20_100] = np.nan
    t, v = envelope(time, values, columns=200)
    assert np.isnan(v).sum() == 2
    for begin, end in ((19.999, 20.1), (49.999, 60.0)):
        inside = (t > begin) & (t < end)
        assert not np.isfinite(v[inside]).any()
        assert np.isnan(v[(t >= begin) & (t <= end)]).any()


def test_a_path_of_many_samples_keeps_the_extremes_of_both_axes() -> None:
    time = np.arange(100_000) * 1e-3
    x, y = np.cos(time), np.sin(time) * (1.0 + 1e-3 * time)
    px, py = path(time, x, y, most=8000)
    assert len(px) <= 8100
    assert (px.min(), px.max(), py.min(), py.max()) == (x.min(), x.max(), y.min(), y.max())


def test_loops_have_a_shade_and_a_label_per_case_sorted_by_amount() -> None:
    record = machine_record(pressure=["5 bar", "50 kPa", "1 bar"], noise=0.0)
    parts = segments(record, "loops")
    assert [f.words for f in told_apart(parts)] == ["50 kPa", "1 bar", "5 bar"]
    fig = against_figure(parts, "span")
    (ax,) = axes(fig).values()
    assert ax.get_xlabel() == "Span, cm"
    shades = [line.get_alpha() for line in ax.get_lines()]
    assert shades == sorted(set(shades))
    labels = {text.get_text(): text.get_color() for text in ax.texts}
    assert {labels[w] for w in ("50 kPa", "1 bar", "5 bar")} == {style.COLOURS["pressure"]}


def test_loops_that_end_in_one_place_have_a_key_instead() -> None:
    record = machine_record(frequency=["1 Hz", "2 Hz"], pressure="5 bar", noise=0.0)
    (ax,) = axes(against_figure(segments(record), "span")).values()
    assert [t.get_text() for t in ax.get_legend().get_texts()] == ["2 Hz", "1 Hz"]


def test_a_tripped_run_and_a_sensor_at_its_limit_are_told() -> None:
    record = RECORD.with_meta(result="tripped", message="Stopped by an interlock.")
    texts = [t.get_text() for t in time_figure([record]).axes[0].texts]
    assert any("Stopped by an interlock." in t and "tension at the end of its range in 1.2 %" in t for t in texts)


def test_the_same_recording_is_the_same_picture() -> None:
    parts = segments(RECORD, "loops")
    for draw in (time_figure, lambda p: against_figure(p, "span")):
        assert style.to_svg(draw(parts)) == style.to_svg(draw(parts))


def test_a_single_sample_and_a_recording_of_true_channels_are_drawn() -> None:
    assert axes(time_figure([Recording([1.0], {"a": Channel([2.0], "N")})]))
    time = np.arange(10.0)
    names = {"tank.pressure": "Pa", "tank.pressure_abs": "Pa", "tube.mass_flow": "kg/s", "room.pressure": "Pa"}
    record = Recording(time, {n: Channel(time * (n != "room.pressure"), u) for n, u in names.items()})
    fig = time_figure([record])
    assert list(axes(fig)) == ["Pressure, bar", "Mass flow, g/s"]
    assert set(lines(fig)) == {"tank", "tube"}


def test_a_single_sample_in_a_step_is_drawn():
    step = {"path": "steps.1", "label": "fill", "start": 0.0, "end": 1e-3, "period": 1e-3, "case": {}}
    channels = {"pressure": Channel(np.array([1e5]), "Pa", "measured")}
    fig = time_figure(Recording(np.zeros(1), channels, {"title": "Stopped", "steps": [step]}))
    low, high = fig.axes[0].get_xlim()
    assert low < 0.0 < high
