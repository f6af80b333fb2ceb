import itertools
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from mckibben.analysis.loops import closed_area
from mckibben.errors import InputError
from mckibben.quantities import from_si
from mckibben.report.figures import style
from mckibben_papers import computed, measured
from mckibben_papers import figure_parts as common
from mckibben_papers import figures_recordings as drawings
from mckibben_papers.figure_parts import as_printed, label, outcome, shown
from mckibben_papers.figures import CONFERENCE, FIGURES, JOURNAL, figure
from mckibben_papers.rows import all_rows, needs_recording

FIRST = (
    "1", "2", "3a", "3b", "3c", "3d", "4", "5a", "5b", "5c", "5d", "5e", "6a", "6b", "7a", "7b", "7c",
    "8a", "8b", "9a", "9b", "10", "11", "12a", "12b", "12c", "13a", "13b", "table1",
)  # fmt: skip
SECOND = ("1994-1", "1994-2", "1994-3a", "1994-3b", "1994-4", "1994-5a", "1994-5b", "1994-table1")
TUBES = ("8a", "8b", "9a", "9b")  # rest on the fits of the tube study, which take half a minute
DRAWN = [k for k, f in FIGURES.items() if not f.recordings and k not in TUBES]
SLOW = [k for k in FIGURES if k not in DRAWN]
DIFFERENT = 1e-9  # what an ulp of the way through units may leave, relative


@pytest.fixture(scope="module")
def drawn():
    """Figures by key, each drawn once."""
    known: dict[str, Figure] = {}

    def draw(key):
        if key not in known:
            known[key] = figure(key).draw()
        return known[key]

    return draw


def ours(identifier):
    return outcome(identifier).ours


def line(fig, gid):
    (found,) = [one for ax in fig.axes for one in ax.get_lines() if one.get_gid() == gid]
    return np.asarray(found.get_xdata(), float), np.asarray(found.get_ydata(), float)


def texts(fig):
    return [t.get_text() for t in fig.findobj(Text) if t.get_text()]


# ---- the registry


def test_the_registry_holds_every_figure_and_table_of_both_papers_in_their_order():
    assert tuple(FIGURES) == (*FIRST, *SECOND)
    assert [f.id for f in FIGURES.values()] == list(FIGURES)
    assert [f.paper for f in FIGURES.values()] == [JOURNAL] * len(FIRST) + [CONFERENCE] * len(SECOND)
    assert all(f.title and f.caption.endswith(".") for f in FIGURES.values())


def test_every_row_that_a_figure_names_is_a_printed_number():
    known = {r.id for r in all_rows()}
    for one in FIGURES.values():
        assert set(one.rows) <= known and len(set(one.rows)) == len(one.rows), one.id


def test_a_figure_needs_recordings_where_one_of_its_rows_does():
    outcome("static.max_tension")  # registers the functions of all rows
    rows = {r.id: r for r in all_rows()}
    for one in FIGURES.values():
        assert one.recordings == any(needs_recording(rows[r]) for r in one.rows), one.id


def test_an_unknown_figure_is_refused_with_those_that_there_are():
    with pytest.raises(InputError, match="14.*Known are 1, 2, 3a"):
        figure("14")


def test_the_registry_is_read_without_loading_what_draws():
    words = "import sys, mckibben_papers.figures; print([m for m in ('matplotlib', 'jax') if m in sys.modules])"
    said = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


# ---- every figure


def is_whole(fig):
    """Axes state quantities and units; keys and words are inside the figure, and keys cover no data."""
    labels = [ax.get_xlabel() for ax in fig.axes if ax.axison], [ax.get_ylabel() for ax in fig.axes if ax.axison]
    if any(ax.axison for ax in fig.axes):
        for side in labels:
            stated = [words for words in side if words]
            assert stated and all(", " in words for words in stated), stated
    with style.styled():
        fig.canvas.draw()
    edge = 2.0  # pixels of rounding
    page = fig.bbox.padded(edge)
    for text in [t for ax in fig.axes for t in ax.texts if t.get_text() and t.get_visible()]:
        box = text.get_window_extent()
        assert page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1, text.get_text()
    # words of one line do not run into each other; what is turned or lies on a curve has no such line
    for ax in fig.axes:
        level = [t for t in ax.texts if t.get_text() and t.get_visible() and not t.get_rotation()]
        rows = {}
        for text in level:
            rows.setdefault(round(text.get_window_extent().y0), []).append(text)
        for row in rows.values():
            for one, other in itertools.combinations(row, 2):
                boxes = one.get_window_extent().padded(-edge), other.get_window_extent()
                assert not boxes[0].overlaps(boxes[1]), (one.get_text(), other.get_text())
    for key in fig.legends:
        box = key.get_window_extent()
        assert page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0, [t.get_text() for t in key.texts]
        assert not any(ax.bbox.padded(-edge).overlaps(box) for ax in fig.axes if ax.axison)


def shows_its_rows(key, fig):
    """Ours of every row stands in the figure; the largest tensions are marks, and the table has its own rounding."""
    words = "\n".join(texts(fig))
    for identifier in figure(key).rows:
        if not (identifier.endswith("max_tension") and key != "6a"):
            assert any(shown(ours(identifier), digits) in words for digits in (2, 3)), identifier


@pytest.mark.parametrize("key", DRAWN)
def test_a_figure_is_drawn_with_units_and_ours_beside_the_printed(drawn, key):
    fig = drawn(key)
    is_whole(fig)
    shows_its_rows(key, fig)
    assert label(key) in "\n".join(texts(fig))


@pytest.mark.slow
@pytest.mark.parametrize("key", SLOW)
def test_a_figure_of_recordings_is_drawn_with_units_and_ours_beside_the_printed(drawn, key):
    fig = drawn(key)
    is_whole(fig)
    if "table1" not in key:
        shows_its_rows(key, fig)
    assert label(key) in "\n".join(texts(fig))


# ---- what is drawn is what the rows say


def test_the_drawn_braid_angle_at_the_free_length_is_that_of_no_tension(drawn):
    length, angle = line(drawn("5a"), "without wall")
    tension = line(drawn("5d"), "without wall")[1]
    # both are read between samples half a millimetre apart, whose curves bend by less than 1e-3
    assert np.interp(np.interp(0.0, tension, length), length, angle) == pytest.approx(
        ours("static.zero_force_angle"), rel=1e-3
    )


def test_the_slope_of_the_drawn_tension_per_pressure_is_kg(drawn):
    length, per_pressure = line(drawn("5d"), "with wall")
    at = np.array(computed.LENGTHS) * from_si(1.0, "m", "cm")
    slope = np.polyfit(at, np.interp(at, length, per_pressure), 1)[0] * from_si(1.0, "N/(bar*cm)", "cm")
    assert slope == pytest.approx(ours("static.stiffness_per_pressure"), rel=1e-3)  # straight between samples


def test_the_drawn_model_has_the_tension_and_the_stiffness_of_the_rows(drawn):
    fig = drawn("6a")
    length, total = line(fig, "total")
    active, passive, beyond = (line(fig, name)[1] for name in ("active", "passive", "non-linear"))
    assert total == pytest.approx(active + passive + beyond, abs=1e-9)  # rounding of 100 N
    straight = (length > 12.0) & (length < 15.0)
    slope, intercept = np.polyfit(length[straight], total[straight], 1)
    assert slope == pytest.approx(ours("static.stiffness_5bar"), rel=1e-6)  # straight there
    assert slope * 15.4 + intercept == pytest.approx(ours("static.max_tension"), rel=1e-6)


@pytest.mark.parametrize(
    ("key", "row", "unit"),
    [
        ("12a", "energy.maximal.input", "cm^3*bar"),
        ("12b", "energy.maximal.output", "N*cm"),
        ("13a", "energy.isotonic.input", "cm^3*bar"),
        ("13b", "energy.isotonic.output", "N*cm"),
    ],
)
def test_the_area_of_a_drawn_cycle_is_its_work(drawn, key, row, unit):
    cycles = [one.get_xydata().T for one in drawn(key).axes[0].get_lines() if closed(one)]
    works = [from_si(1.0, unit, "J") * abs(closed_area(*points)) for points in cycles]
    # the curved legs are polygons of 256 pieces; with the accumulator there are other cycles beside
    assert min(abs(work - ours(row)) for work in works) < 2e-4 * ours(row)


def closed(one):
    points = one.get_xydata()
    return len(points) > 4 and np.allclose(points[0], points[-1])


def test_the_drawn_efficiency_at_five_bar_and_its_top_are_the_rows(drawn):
    curve = drawn("12c").axes[0].get_lines()[0]
    pressure, share = curve.get_xdata(), 0.01 * curve.get_ydata()
    # parabolas through samples that are denser than 0.2 bar
    assert np.interp(5.0, pressure, share) == pytest.approx(ours("energy.maximal.efficiency"), rel=1e-4)
    assert pressure[np.nanargmax(share)] == pytest.approx(ours("energy.maximal.best_pressure"), abs=0.15)


def test_without_friction_the_drawn_efficiency_with_the_accumulator_is_the_misprint(drawn):
    dashed = drawn("12c").axes[0].get_lines()[3]
    printed = common.printed("energy.maximal.efficiency_accumulator")
    assert np.interp(5.0, dashed.get_xdata(), 0.01 * dashed.get_ydata()) == pytest.approx(
        printed, abs=0.005
    )  # two digits


@pytest.mark.slow
@pytest.mark.parametrize(("key", "row"), [("8a", "tube.quadratic_rms_10in3"), ("9b", "tube.inertial_rms_3in3")])
def test_the_drawn_pressures_differ_by_the_rms_of_the_row(drawn, key, row):
    squares = []
    for ax in drawn(key).axes:
        curves = {one.get_gid(): np.asarray(one.get_ydata()) for one in ax.get_lines()}
        squares.append(np.mean((curves["simulation"] - curves["reference"]) ** 2))
    assert np.sqrt(np.mean(squares)) == pytest.approx(ours(row), rel=DIFFERENT)


@pytest.mark.slow
def test_the_drawn_loop_has_the_height_of_the_row_and_its_samples_are_the_recording(drawn):
    length, tension = line(drawn("3a"), "5 bar")
    rising, falling = np.split(np.arange(2 * drawings.POINTS), 2)
    middle = 0.5 * (length.min() + length.max())
    height = np.interp(middle, length[rising], tension[rising]) - np.interp(
        middle, length[falling][::-1], tension[falling][::-1]
    )
    # the mean of heights against the height of mean paths: noise of 0.1 N over the samples of a window
    assert height == pytest.approx(ours("loop.height"), abs=0.15)
    samples = line(drawn("3a"), "5 bar, samples")[1]
    assert np.array_equal(samples, measured.triangle()["tension"])


@pytest.mark.slow
def test_the_drawn_rise_takes_the_time_of_the_row(drawn):
    time, tension = line(drawn("10"), "full rise")
    final = np.median(tension[time > 90.0])
    begin = time[np.argmax(tension > 0.02 * final)]
    end = time[np.argmax(tension > 0.9 * final)]
    assert end - begin == pytest.approx(ours("isometric.rise_full"), abs=3.0)  # one step of three, noise at its onset


@pytest.mark.slow
@pytest.mark.parametrize(("case", "name"), list(zip((measured.LIGHT, measured.FAST), drawings.CASES, strict=True)))
def test_the_drawn_power_has_the_peak_of_the_row(drawn, case, name):
    _, power = line(drawn("11"), f"power {name}")
    assert power.max() <= measured.power(case).largest_power * (1.0 + DIFFERENT)
    assert power.max() == pytest.approx(
        ours(f"isotonic.peak_power_{name}"), rel=0.05
    )  # the largest of three, not their mean


# ---- numbers in words


@pytest.mark.parametrize(
    ("value", "digits", "words"),
    [(0.2926, 3, "0.293"), (1260.0, 3, "1\N{THIN SPACE}260"), (0.0, 3, "0"), (-16.04, 3, "−16.0"), (5.41e-6, 3, "5.41·10⁻⁶"),
     (0.0569, 3, "0.0569"), (23.0, 2, "23")],
)  # fmt: skip
def test_ours_has_the_digits_that_were_asked_for(value, digits, words):
    assert shown(value, digits) == words


@pytest.mark.parametrize(
    ("value", "words"),
    [(0.29, "0.29"), ((0.2, 0.5), "0.2–0.5"), (4.91e-6, "4.91·10⁻⁶"), (5.0, "5"), (0.00126, "0.00126")],
)
def test_the_printed_has_the_digits_in_print(value, words):
    assert as_printed(value) == words


def test_a_key_reads_as_the_number_in_print():
    assert [label(k) for k in ("3a", "1994-3b", "table1", "1994-table1")] == [
        "Fig. 3a", "Fig. 3b, 1994", "Table 1", "Table 1, 1994",
    ]  # fmt: skip
