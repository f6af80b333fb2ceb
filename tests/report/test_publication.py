"""Figures to publish: every figure function at every width and in every style, on its canvas, readable, in gray."""

import re

import gallery
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.text import Text

import mckibben as mk
from mckibben.errors import InputError
from mckibben.report.figures import formats, style
from mckibben.report.figures.formats import LEAST_TYPE, gray_of, named_style

FIGURES = gallery.figures()
# Drawings and tables to scale, and tables of many columns, which need the width of a page; they say so.
PAGE_ONLY = ("bench", "tubes", "validation", "paper 7a")


def drawn(name: str, look: str, width: str | None):
    """A figure in a style, or None where it refuses the width."""
    with mk.figure_style(look, width=width):
        try:
            result = FIGURES[name]()
        except InputError as error:
            assert name in PAGE_ONLY and re.search(r"width must be at least \d+ mm", str(error)), (name, error)
            return None
    return result.get_figure(root=True) if isinstance(result, Axes) else result


@pytest.fixture(scope="module")
def printed():
    """Every figure in gray at the width of a column, of those that need it at that of a page."""
    return {name: drawn(name, "gray", None) or drawn(name, "gray", "page") for name in FIGURES}


def texts(fig) -> list[Text]:
    """Texts that are drawn."""
    hidden = {
        t for k in fig.findobj(lambda a: hasattr(a, "legend_handles") and not a.get_visible()) for t in k.findobj(Text)
    }
    found = [t for t in fig.findobj(Text) if t.get_text().strip() and t.get_visible() and t not in hidden]
    off = {label for ax in fig.axes if not ax.axison for axis in (ax.xaxis, ax.yaxis) for label in axis.findobj(Text)}
    ticks = [
        label
        for ax in fig.axes
        for axis in (ax.xaxis, ax.yaxis)
        for label in (*axis.get_ticklabels(which="both"), axis.offsetText)
    ]
    shown = {t for ax in fig.axes for axis in (ax.xaxis, ax.yaxis) for t in _shown_ticks(axis)}
    return [t for t in found if t not in off and (t not in ticks or t in shown)]


def _shown_ticks(axis) -> list[Text]:
    low, high = sorted(axis.get_view_interval())
    inside = [t for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
    return [t.label1 for t in inside if t.label1.get_visible()]


def outside(fig) -> list[str]:
    """Texts that stand beyond the canvas by more than half a point."""
    fig.draw_without_rendering()
    renderer, (wide, high), slack = fig.canvas.get_renderer(), fig.bbox.size, 0.5 * fig.dpi / 72.0
    found = []
    for text in texts(fig):
        if isinstance(text.axes, Axes) and text.get_clip_on():
            continue
        box = text.get_window_extent(renderer)
        if box.x0 < -slack or box.y0 < -slack or box.x1 > wide + slack or box.y1 > high + slack:
            found.append(text.get_text())
    return found


@pytest.mark.parametrize("name", FIGURES)
def test_no_text_of_a_printed_figure_leaves_its_canvas_or_is_too_small(printed, name):
    fig = printed[name]
    assert outside(fig) == []
    assert {t.get_text(): t.get_fontsize() for t in texts(fig) if t.get_fontsize() < LEAST_TYPE} == {}


def test_a_figure_has_exactly_the_width_that_was_asked_for(printed):
    for name, fig in printed.items():
        width = named_style("gray", width="page" if name in PAGE_ONLY else None).width
        # A drawing to scale that is smaller than the page is not blown up.
        assert fig.get_figwidth() == pytest.approx(width, abs=0.2 if name in PAGE_ONLY else 1e-9), name


def test_lines_of_a_printed_figure_differ_without_colour(printed):
    for name, fig in printed.items():
        for ax in fig.axes:
            looks: dict = {}
            for line in formats.series(ax):
                if formats.appearance(line)[0] != "None":
                    bundle = (
                        line.get_alpha(),
                        line.get_linewidth(),
                        line.get_gid(),
                        line.get_label().strip("_0123456789"),
                    )
                    looks.setdefault(formats.appearance(line), set()).add(bundle)
            assert all(len(bundles) == 1 for bundles in looks.values()), (name, ax.get_ylabel(), looks)


def test_a_gray_figure_has_no_colour(printed):
    for name in ("force map", "recording", "sizing", "energy flow", "comparison", "circuit fit"):
        fig = printed[name]
        colours = set(re.findall(r"#[0-9a-f]{6}\b", style.to_svg(fig)))
        assert all(c[1:3] == c[3:5] == c[5:7] for c in colours), name


# One figure in axes and one drawing freely; the others are tried at the narrowest width above.
@pytest.mark.parametrize("name", ["recording", "energy flow"])
@pytest.mark.parametrize("look", ["print", "projector"])
def test_no_text_leaves_the_canvas_of_a_page_or_a_slide(name, look):
    fig = drawn(name, look, "page" if look == "print" else None)
    assert outside(fig) == []


def test_a_projected_figure_has_thicker_lines():
    plain, thick = (drawn("force map", look, "slide").axes[0].get_lines()[0] for look in ("print", "projector"))
    assert thick.get_linewidth() == pytest.approx(formats.STROKES * plain.get_linewidth())


def test_every_format_opens_and_says_what_it_shows(printed, tmp_path):
    fig = printed["force map"]
    for ending in ("svg", "pdf", "png"):
        mk.save_figure(fig, tmp_path / f"map.{ending}")
    title = "Nylon shell muscle of Chou and"
    svg, pdf, png = ((tmp_path / f"map.{ending}").read_bytes() for ending in ("svg", "pdf", "png"))
    assert b"<text" in svg and b"<dc:creator>mckibben" in svg and title.encode() in svg
    assert pdf.startswith(b"%PDF") and f"mckibben {mk.__version__}".encode() in pdf and b"CreationDate" not in pdf
    assert b"/FontFile2" in pdf or b"/CIDFontType2" in pdf  # type 42: outlines are in the file
    assert png.startswith(b"\x89PNG") and f"mckibben {mk.__version__}".encode() in png
    with pytest.raises(InputError, match=r"ends in \.svg or \.pdf or \.png"):
        mk.save_figure(fig, tmp_path / "map.jpg")


def test_the_same_figure_is_the_same_pdf(printed, tmp_path):
    for name in ("a.pdf", "b.pdf"):
        mk.save_figure(printed["loop"], tmp_path / name)
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


def test_a_style_ends_with_its_block_and_reaches_figures_of_the_user():
    import matplotlib

    with mk.figure_style("print", width="100 mm", font="serif") as look:
        assert matplotlib.rcParams["pdf.fonttype"] == 42
        assert matplotlib.rcParams["figure.figsize"][0] == pytest.approx(look.width)
    assert drawn_screen() == pytest.approx(style.MIDDLE)


def drawn_screen() -> float:
    return float(mk.muscle("nylon").plot.free_length().get_figure(root=True).get_figwidth())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"name": "prnt"}, "Did you mean 'print'"),
        ({"width": "3 cm"}, "must be between 7 cm and 120 cm"),
        ({"width": "colum"}, "column, page, slide"),
        ({"font": "comic"}, "font"),
        ({"name": "projector", "gray": True}, "gray figures are for print"),
    ],
)
def test_a_style_that_there_is_not_is_named(options, said):
    with pytest.raises(InputError, match=said):
        named_style(**options)


def test_the_gray_of_a_colour_is_as_light_as_the_colour():
    assert gray_of("#ffffff") == "#ffffff" and gray_of("#000000") == "#000000"
    assert np.diff([int(gray_of(c)[1:3], 16) for c in ("#0000ff", "#ff0000", "#00ff00")]).min() > 0  # blue is darkest
