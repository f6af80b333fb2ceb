import re

import numpy as np
import pytest
from matplotlib.figure import Figure

from mckibben.identification import fit
from mckibben.identification.ranking import Ranking
from mckibben.muscles.braid import braid_of
from mckibben.muscles.build import build_law, law_from_specimen
from mckibben.recordings import ForceMap
from mckibben.report.figures import fit_figures, muscle_figures, style
from mckibben.specimens import specimen


def table() -> ForceMap:
    law = build_law("ideal", {"thread_length": 0.3, "turns": 3.0})
    length, pressure = (a.ravel() for a in np.meshgrid(np.linspace(0.18, 0.25, 5), np.linspace(1e5, 5e5, 5)))
    tension = np.asarray(law.tension(length, pressure)) + 0.5 * np.sin(40.0 * np.arange(length.size))
    short = length < 0.185
    return ForceMap(name="made", length=length, pressure=pressure, tension=np.where(short, 0.0, tension))


@pytest.fixture(scope="module")
def study() -> Ranking:
    points = table()
    fits = [fit("ideal", points, schemes=("pressure", "length"), train_below=3e5)]
    return Ranking("Made up", None, points, fits, [("Someone, published coefficients", fits[0].error * 2.0)])


def every_figure(study: Ranking) -> dict[str, Figure]:
    best, law = study.fits[0], law_from_specimen(specimen("nylon"), "ideal")
    shape = braid_of(law)
    assert shape is not None
    x = np.concatenate([np.linspace(0, 0.01, 20), np.linspace(0.01, 0, 20)])
    loop = muscle_figures.DrawnLoop(x, 1e3 * x + np.sign(np.gradient(x)), "whole")
    figures = {
        "curves": fit_figures.tension_curves(best, study.points),
        "residuals": fit_figures.residuals(best),
        "ranking": fit_figures.ranking(study),
        "correlation": fit_figures.correlation(best),
        "hold_out": fit_figures.hold_out(best),
        "overview": fit_figures.overview([study]),
        "law": muscle_figures.law_curves(law, title="Nylon", pressures=[1e5, 5e5]),
        "muscle": muscle_figures.muscle_drawing(shape, [0.15, 0.10], title="Nylon", remarks=["long"]),
        "loop": muscle_figures.loop_figure(loop, title="Loop"),
    }
    assert all(f is not None for f in figures.values())
    return {k: v for k, v in figures.items() if v is not None}


@pytest.fixture(scope="module")
def figures(study: Ranking) -> dict[str, Figure]:
    return every_figure(study)


def test_axes_that_carry_numbers_state_a_quantity_and_its_unit(figures: dict[str, Figure]) -> None:
    for name, fig in figures.items():
        for ax in fig.axes:
            if not ax.axison:
                continue
            assert re.search(r", (cm|cm³|mm|bar|N|%)", ax.get_xlabel()), (name, ax.get_xlabel())
            if len(ax.get_yticks()):
                assert re.search(r", (cm|cm³|mm|bar|N|%)", ax.get_ylabel()), (name, ax.get_ylabel())


def test_axis_titles_take_the_colour_of_their_quantity(figures: dict[str, Figure]) -> None:
    words = {
        "Pressure": "pressure",
        "Tension": "tension",
        "Length": "length",
        "Free length": "length",
        "Displacement": "length",
    }
    for fig in figures.values():
        for axis in (a for ax in fig.axes for a in (ax.xaxis, ax.yaxis)):
            title = axis.label.get_text().split(",")[0]
            if title in words:
                assert axis.label.get_color() == style.COLOURS[words[title]]


def test_the_same_figure_is_the_same_text(study: Ranking, figures: dict[str, Figure]) -> None:
    again = every_figure(study)
    for name, fig in figures.items():
        text = style.to_svg(fig)
        assert text == style.to_svg(again[name]), name
        assert "<dc:date" not in text and "NaN" not in text and "nan" not in re.sub(r"<[^>]*>", "", text), name


def test_a_figure_in_a_page_brings_no_style_of_its_own_and_follows_the_theme(figures: dict[str, Figure]) -> None:
    text = style.inline_svg(figures["curves"], "one", 'a "label" <b>')
    assert (
        text.startswith("<svg")
        and "<style" not in text
        and "http" not in text.replace('xmlns="http://www.w3.org/2000/svg"', "")
    )
    assert "var(--q-tension)" in text and style.COLOURS["tension"] not in text
    assert "&lt;b&gt;" in text and all(i.startswith("one-") for i in re.findall(r' id="([^"]+)"', text))


def test_a_png_has_no_date_and_is_written(figures: dict[str, Figure], tmp_path) -> None:
    style.save(figures["overview"], tmp_path / "a.png", dpi=40.0)
    style.save(figures["overview"], tmp_path / "b.png", dpi=40.0)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_labels_move_apart_and_no_further_than_needed() -> None:
    assert style.spread([1.0, 30.0], 10.0) == [1.0, 30.0]
    places = style.spread([5.0, 6.0, 7.0, 40.0], 10.0, low=0.0)
    assert np.all(np.diff(places) >= 10.0 - 1e-9) and places[0] >= 0.0 and places[3] == 40.0
    assert style.spread([7.0, 5.0], 10.0) == [11.0, 1.0]


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(1653.5, 1, "1\u2009653.5"), (-0.004, 2, "0.00"), (-2.5, None, "−2.5"), (float("nan"), 1, "–"), (0.0, None, "0")],
)
def test_numbers_as_people_write_them(value: float, digits: int | None, text: str) -> None:
    assert style.number(value, digits) == text


def test_a_curve_starts_at_its_free_length() -> None:
    lengths, force = fit_figures.pulling(np.array([1.0, 2.0, 3.0]), np.array([-2.0, 2.0, 5.0]))
    assert lengths.tolist() == [1.5, 2.0, 3.0] and force.tolist() == [0.0, 2.0, 5.0]
    assert fit_figures.pulling(np.array([1.0, 2.0]), np.array([-2.0, -1.0]))[0].size == 0


def test_importing_the_figures_leaves_pyplot_alone() -> None:
    import subprocess
    import sys

    code = "import sys, mckibben.report.fit_report; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_picture_of_a_single_map_is_filled_from_side_to_side(figures):
    boxes = [ax.get_position() for ax in figures["overview"].axes]
    assert min(b.x0 for b in boxes) < 0.1
    assert max(b.x1 for b in boxes) > 0.8  # the columns of the ranking stand to the right of its axes


def test_curves_of_a_law_are_drawn_though_its_range_ends_below_the_rest_length():
    """A law fitted to lengths below the rest length states nothing beyond them: its curves end there, and are there."""
    law = law_from_specimen(specimen("nylon"), changes={"upper_length": 0.13})
    lengths, pressures = (grid.ravel() for grid in np.meshgrid([0.12, 0.13], [3e5, 5e5]))
    points = ForceMap("short", lengths, pressures, np.asarray(law.tension(lengths, pressures)))
    figure = Figure()
    axes = figure.add_subplot()
    fit_figures.draw_curves(axes, law, points.with_rest_length(0.14), top=points.largest)
    ends = [line.get_xydata()[-1] for line in axes.lines if line.get_linestyle() == "-" and len(line.get_xydata()) > 9]
    # Each curve ends at its point at 13 cm; the grid ends there exactly.
    assert sorted(end[1] for end in ends) == pytest.approx(sorted(points.tension[lengths == 0.13]), rel=1e-9)
    assert {round(float(end[0]), 6) for end in ends} == {13.0}
