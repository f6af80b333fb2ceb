"""What `.plot` of the public objects draws, and how notebooks show them."""

from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import mckibben as mk
from mckibben.errors import InputError
from mckibben.recordings import Channel, ForceMap, Recording


@pytest.fixture(scope="module")
def muscle():
    return mk.muscle("nylon")


@pytest.fixture(scope="module")
def recording():
    time = np.linspace(0.0, 1.0, 50)
    channels = {
        "pressure": Channel(1e5 * time, "Pa", "measured"),
        "span": Channel(0.12 + 0.01 * np.sin(time), "m", "measured"),
        "tension": Channel(30.0 * time, "N", "measured"),
    }
    return Recording(time, channels, {"title": "Ramp"})


@pytest.fixture(scope="module")
def ranking():
    law = mk.law("ideal", {"thread_length": 0.16, "turns": 3.2})
    length, pressure = (a.ravel() for a in np.meshgrid(np.linspace(0.11, 0.14, 4), [2e5, 4e5]))
    return mk.fit(ForceMap("made", length, pressure, np.asarray(law.tension(length, pressure))), ["ideal"], schemes=())


def plots(muscle, recording, ranking):
    return {
        "force_map": lambda ax: muscle.plot.force_map(pressures="1:3 bar", ax=ax),
        "free_length": lambda ax: muscle.plot.free_length(ax=ax),
        "volume": lambda ax: muscle.plot.volume(["2 bar", "4 bar"], ax=ax),
        "braid": lambda ax: muscle.plot.braid(["14 cm", "10 cm"], ax=ax),
        "channels": lambda ax: recording.plot("pressure", ax=ax),
        "against": lambda ax: recording.plot.against("span", ax=ax),
        "ranking": lambda ax: ranking.plot(ax=ax),
        "curves": lambda ax: ranking.plot.curves(ax=ax),
        "fit": lambda ax: ranking.best.plot(ax=ax),
    }


def test_a_plot_draws_into_the_axes_that_it_is_given(muscle, recording, ranking):
    for name, plot in plots(muscle, recording, ranking).items():
        ax = Figure().add_subplot()
        assert plot(ax) is ax and ax.has_data(), name


def test_a_plot_without_axes_returns_axes_that_a_notebook_shows(muscle, recording, ranking):
    for name, plot in plots(muscle, recording, ranking).items():
        ax = plot(None)
        assert isinstance(ax, Axes), name
        assert ElementTree.fromstring(ax._repr_svg_()).tag.endswith("svg"), name


def test_axes_of_one_quantity_refuse_channels_of_several(recording):
    with pytest.raises(InputError, match="must be of one quantity"):
        recording.plot(["pressure", "span"], ax=Figure().add_subplot())
    with pytest.raises(InputError, match="Did you mean 'tension'"):
        recording.plot("tensoin")


def test_a_range_of_pressures_has_a_line_each(muscle):
    ax = muscle.plot.force_map(pressures="1:4 bar")
    assert sum(len(line.get_xdata()) > 2 for line in ax.lines) == 4


def test_tables_for_notebooks_are_well_formed(muscle, recording, ranking):
    for shown, words in ((muscle, "length at rest"), (recording, "tension"), (ranking, "ideal")):
        text = shown._repr_html_()
        assert words in text
        ElementTree.fromstring(f"<div>{text}</div>")


def test_a_biological_muscle_shows_its_table_and_draws_nothing():
    fibre = mk.muscle("fast-fibre")
    assert "optimal length" in fibre._repr_html_()
    with pytest.raises(InputError, match="must be a McKibben muscle"):
        fibre.plot()
