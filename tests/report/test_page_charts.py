"""A chart of a page becomes a figure with the same lines, labels and axes, or the part of it that is shown."""

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.report.figures.page_charts import chart_figure
from mckibben.web.charts import figure_file, part_of, sent_chart, sent_figure


def chart(**more):
    x = np.linspace(0.0, 10.0, 50)
    line = {"x": x.tolist(), "y": np.sin(x).tolist(), "label": "A nylon", "quantity": "tension"}
    axes = {"x": {"label": "length", "unit": "cm", "quantity": "length"}, "y": {"label": "Tension", "unit": "N"}}
    return {"name": "Tension", **axes, "lines": [line, {**line, "dash": "B", "label": "B"}], "marks": [], **more}


def test_a_figure_has_the_lines_of_the_chart_in_their_units():
    ax = chart_figure(chart()).axes[0]
    assert [len(line.get_xdata()) for line in ax.lines] == [50, 50]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Length, cm", "Tension, N")
    assert {text.get_text() for text in ax.texts} >= {"Tension", "A nylon", "B"}


def test_a_figure_of_a_zoomed_chart_shows_the_same_part():
    ax = chart_figure(chart(), {"x": [2.0, 3.0], "y": [0.0, 1.0]}).axes[0]
    assert ax.get_xlim() == (2.0, 3.0) and ax.get_ylim() == (0.0, 1.0)


def test_charts_over_one_axis_stand_below_each_other():
    fig = chart_figure({"name": "Run", "charts": [chart(), chart()]}, {"x": [2.0, 3.0]})
    assert len(fig.axes) == 2 and [ax.get_xlim() for ax in fig.axes] == [(2.0, 3.0)] * 2
    assert fig.axes[0].get_position().y0 > fig.axes[1].get_position().y1


@pytest.mark.parametrize(("suffix", "begins"), [("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG")])
def test_a_figure_is_saved_in_every_format(suffix, begins):
    name, data = figure_file("Tension over length", lambda part: chart_figure(chart(), part), {"format": suffix})
    assert name == f"tension-over-length.{suffix}" and data.startswith(begins)


def test_a_browser_gets_no_other_format_and_may_send_no_other_document():
    with pytest.raises(InputError, match="style"):
        figure_file("x", lambda part: chart_figure(chart()), {"format": "svg", "style": "none"})
    with pytest.raises(InputError, match="format"):
        figure_file("x", lambda part: chart_figure(chart()), {"format": "exe"})
    for document in (None, {"lines": [{"x": [1.0], "y": []}]}, {"name": "x", "lines": [], "x": 1, "y": 2}):
        with pytest.raises(InputError, match="document of a chart"):
            sent_chart(document)
    for body in (b"", b"[1", b"\xff", b"[]"):
        with pytest.raises(InputError, match="document of a chart"):
            sent_figure(body)
    kept = sent_chart(chart(lines=[{"x": [0, 1], "y": [None, 1], "quantity": "__class__", "dash": "B"}]))
    assert kept["lines"][0]["quantity"] == ""  # a quantity that is none has no colour


def test_a_part_that_is_none_is_all_of_the_chart():
    assert part_of(None) is None and part_of({"x": "all"}) is None and part_of({"x": [1, 2]}) == {"x": [1.0, 2.0]}
