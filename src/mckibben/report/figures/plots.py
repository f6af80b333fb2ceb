"""What ``.plot`` of a muscle, a recording, a ranking, a sizing and an energy account draws, and how notebooks show them.

Every method draws into the axes given as ``ax``, or into a figure of its own, and returns axes. Such a figure is shown by a
notebook that ends a cell with the axes, and is saved by ``ax.figure.savefig``; pyplot is never imported.
"""

from __future__ import annotations

import html
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from ...analysis.segments import segments
from ...documents import path_text
from ...errors import InputError
from ...muscles import Muscle
from ...quantities import from_si, in_si, shown_unit, values_in_si
from ...recordings import ForceMap, Recording, read
from . import (
    analysis_figures,
    comparison_figures,
    energy_figures,
    fit_figures,
    muscle_figures,
    recording_figures,
    sizing_figures,
    style,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...analysis.energy import WorkingCycles
    from ...analysis.energy_accounts import EnergyAccount
    from ...identification.fit import Fit
    from ...identification.posterior import Posterior
    from ...identification.ranking import Ranking
    from ...studies.comparison import MuscleTable
    from ...studies.sizing import Sizing

PRESSURES = "1:5 bar"
DRAWN_PRESSURE = 3e5  # gauge, at which the braid is drawn beside its longest length [Pa]


class ShownAxes(Axes):
    """Axes of a figure of this package, which a notebook shows as a picture."""

    def _repr_svg_(self) -> str:
        fig = self.get_figure(root=True)
        assert fig is not None
        return style.to_svg(fig)


def shown(fig: Figure) -> Axes:
    """The first axes of a finished figure, as axes that a notebook shows; ``.figure.axes`` has the others."""
    first = fig.axes[0]
    first.__class__ = ShownAxes
    return first


@style.styled()
def drawn(draw: Callable[[Axes], object], ax: Axes | None, *, width: float = style.MIDDLE, height: float = 3.9) -> Axes:
    """Draw into axes, or into those of a figure of a width and height [inch] where there are none."""
    if ax is not None:
        draw(ax)
        return ax
    fig = style.figure(width, height)
    draw(fig.add_axes((0.62 / width, 0.52 / height, 1.0 - 1.45 / width, 1.0 - 1.05 / height)))
    return shown(fig)


class MusclePlots:
    """Plots of a muscle; called, it draws `force_map`."""

    def __init__(self, muscle: Muscle) -> None:
        if muscle.is_biological:
            raise InputError("muscle", muscle.title, "must be a McKibben muscle; a biological one is not drawn alone")
        self._muscle, self._law = muscle, muscle.law

    def __call__(self, **options: Any) -> Axes:
        """`force_map` with its options."""
        return self.force_map(**options)

    def force_map(
        self,
        pressures: str | Iterable[float | str] = PRESSURES,
        lengths: tuple[float | str, float | str] | None = None,
        *,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw tension over length, one line per gauge pressure.

        Args:
            pressures: numbers [Pa], texts with a unit, or a range such as ``"1:5 bar"``.
            lengths: shortest and longest length [m]; the working lengths where left out.
            ax: axes to draw into.
        """
        bars = np.array(sorted(values_in_si(pressures, "Pa", field="pressures")))
        span = self._lengths(lengths, float(bars[-1]))

        def draw(axes: Axes) -> None:
            muscle_figures.draw_tension(axes, self._law, span, bars)
            style.heading(axes, self._muscle.title, "○ free length", above=24.0)

        return drawn(draw, ax)

    def free_length(self, highest: float | str = "5 bar", *, ax: Axes | None = None) -> Axes:
        """Draw the length of the unloaded muscle over gauge pressure, up to the highest [Pa]."""
        top = float(in_si(highest, "Pa", field="highest"))
        return drawn(lambda axes: muscle_figures.draw_free_length(axes, self._law, top), ax)

    def volume(
        self,
        pressures: str | Iterable[float | str] = PRESSURES,
        lengths: tuple[float | str, float | str] | None = None,
        *,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw gas volume over length at the lowest and highest of the gauge pressures.

        Args:
            pressures: numbers [Pa], texts with a unit, or a range such as ``"1:5 bar"``.
            lengths: shortest and longest length [m]; the working lengths where left out.
            ax: axes to draw into.

        Raises:
            NoVolumeError: if the law knows only how the volume changes.
        """
        bars = np.array(sorted(values_in_si(pressures, "Pa", field="pressures")))
        span = self._lengths(lengths, float(bars[-1]))
        return drawn(lambda axes: muscle_figures.draw_volume(axes, self._law, span, bars), ax)

    def braid(self, lengths: Iterable[float | str] | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the braid to scale.

        Args:
            lengths: of the braid [m]; at rest, and unloaded at 3 bar, where left out.
            ax: axes to draw into.

        Raises:
            InputError: if the law has no braid.
        """
        shape = muscle_figures.stated_braid(self._law, self._muscle.specimen)
        if shape is None:
            raise InputError(
                "law", self._muscle.law_name, "it has no braid: thread_length and turns, or an angle at rest"
            )
        longest = 0.999 * shape.thread_length
        usual = [self._muscle.rest_length or muscle_figures.working_lengths(self._law, DRAWN_PRESSURE)[1],
                 self._muscle.free_length(DRAWN_PRESSURE)]  # fmt: skip
        asked = usual if lengths is None else values_in_si(list(lengths), "m", field="lengths")
        order = sorted((min(length, longest) for length in asked), reverse=True)
        if ax is None:
            return shown(muscle_figures.muscle_drawing(shape, order, title=self._muscle.title))
        muscle_figures.draw_muscle(ax, shape, order)
        return ax

    def _lengths(self, lengths: tuple[float | str, float | str] | None, highest: float) -> tuple[float, float]:
        if lengths is None:
            return muscle_figures.working_lengths(self._law, highest)
        low, high = values_in_si(list(lengths), "m", field="lengths")
        return low, high


class RecordingPlots:
    """Plots of a recording; called, it draws channels over time."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording

    @style.styled()
    def __call__(
        self, channels: str | Sequence[str] | None = None, *, title: str | None = None, ax: Axes | None = None
    ) -> Axes:
        """Draw channels over time, one pair of axes per quantity.

        Args:
            channels: names; what is measured where left out.
            title: instead of the recording's own.
            ax: axes to draw the channels of one quantity into.

        Raises:
            InputError: there is no such channel; or the channels have several quantities and there is one pair of axes.
        """
        names = [channels] if isinstance(channels, str) else channels
        if ax is None:
            return shown(recording_figures.time_figure(self._recording, channels=names, title=title))
        panel = self._panel(recording_figures.usual_channels([self._recording]) if names is None else names)
        recording_figures.draw_panel(ax, [self._recording], panel)
        style.quantity_axes(ax, x=("Time, s", None), y=(panel.heading, panel.quantity))
        return ax

    @style.styled()
    def against(
        self,
        across: str,
        channels: str | Sequence[str] | None = None,
        *,
        of: str | None = None,
        title: str | None = None,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw channels over another channel, such as tension over span.

        Args:
            across: channel on the horizontal axis.
            channels: names; the measured tension where left out.
            of: label of steps of the protocol, such as ``"loops"``: only their samples are drawn, each case in a
                shade of its own.
            title: instead of the recording's own.
            ax: axes to draw the channels of one quantity into.

        Raises:
            InputError: there is no such channel or step.
        """
        parts = [self._recording] if of is None else segments(self._recording, of)
        names = [channels] if isinstance(channels, str) else channels
        if ax is None:
            return shown(recording_figures.against_figure(parts, across, channels=names, title=title))
        panel, x = self._panel(names or ["tension"]), self._panel([across])
        recording_figures.draw_against(ax, recording_figures.told_apart(parts), panel, x)
        style.quantity_axes(ax, x=(x.heading, x.quantity), y=(panel.heading, panel.quantity))
        return ax

    @style.styled()
    def loop(
        self,
        measured: Recording | ForceMap | str | Path | None = None,
        *,
        across: str = "span",
        channel: str = "tension",
        title: str | None = None,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw a loop of two channels, and measured data over it with their residuals.

        Args:
            measured: recording or table of your own, or its file in any format that `mckibben.read` takes; below the loop
                stands the residual, simulated less measured, and the heading states its rms in the unit of the channel
                and in % of the measured range.
            across: channel on the horizontal axis.
            channel: channel on the vertical axis.
            title: instead of the recording's own.
            ax: axes to draw the loop into, without the residuals.

        Raises:
            InputError: there is no such channel, no full cycle, or no common range.
        """
        if measured is None:
            return self.against(across, channel, title=title, ax=ax)
        data = read(measured) if isinstance(measured, str | Path) else measured
        if ax is None:
            drawn = analysis_figures.measured_loop_figure(
                self._recording, data, across=across, channel=channel, title=title
            )
            return shown(drawn)
        x, y = self._panel([across]), self._panel([channel])
        analysis_figures.draw_measured_loop(ax, self._recording, data, x, y)
        style.quantity_axes(ax, x=(x.heading, x.quantity), y=(y.heading, y.quantity))
        return ax

    def _panel(self, names: Sequence[str]) -> recording_figures.ChannelPanel:
        known = recording_figures.checked_names(self._recording, names, field="channels")
        panels = recording_figures.panels(self._recording, known)
        if len(panels) > 1:
            several = ", ".join(panel.title.lower() for panel in panels)
            raise InputError(
                "channels", ", ".join(known), f"must be of one quantity for one pair of axes; they are {several}"
            )
        return panels[0]


def plot_loops(
    recordings: Sequence[Recording] | str | Path,
    *,
    across: str = "span",
    channel: str = "tension",
    words: Sequence[str] | None = None,
    title: str = "",
) -> Axes:
    """Draw the loops of several recordings over one another, each labelled at its line by what it differs in.

    Args:
        recordings: recordings, or the folder of a sweep that kept the samples of both channels.
        across: channel on the horizontal axis.
        channel: channel on the vertical axis.
        words: a label for each recording, instead of the metadata in which they differ.
        title: heading; the title of the first recording where left out.

    Raises:
        InputError: there is no such channel, or the folder holds no samples of it.

    Examples:
        >>> import numpy as np
        >>> import mckibben as mk
        >>> turn = np.linspace(0.0, 6.28, 50)
        >>> channels = {"span": mk.Channel(0.13 + 0.01 * np.cos(turn), "m"), "tension": mk.Channel(30 + np.sin(turn), "N")}
        >>> slow, fast = (mk.Recording(turn, channels, {"rate": rate}) for rate in ("1 Hz", "2 Hz"))
        >>> [text.get_text() for text in mk.plot_loops([slow, fast]).texts[1:]]
        ['1 Hz', '2 Hz']
    """
    if isinstance(recordings, str | os.PathLike):
        folder = Path(path_text(recordings, "recordings"))
        loops, x, y = analysis_figures.loops_of_sweep(folder, across=across, channel=channel)
    else:
        some: Any = recordings
        if not (isinstance(some, Sequence) and some and all(isinstance(one, Recording) for one in some)):
            raise InputError("recordings", None, f"must be recordings, one or more, or a sweep's folder, got {some!r}")
        loops, x, y = analysis_figures.loops_of_recordings(some, across=across, channel=channel, words=words)
        title = title or str(some[0].meta.get("title", ""))
    return shown(analysis_figures.swept_loops_figure(loops, x, y, title=title))


class FitPlots:
    """Plots of a fit of one law; called, it draws the law through the points."""

    def __init__(self, fit: Fit) -> None:
        self._fit = fit

    def __call__(self, *, ax: Axes | None = None) -> Axes:
        """Draw the measured tension over length, and the fitted law through it, one line per pressure."""

        def draw(axes: Axes) -> None:
            fit_figures.draw_fit(axes, self._fit, self._fit.points)
            style.heading(axes, fit_figures.law_title(self._fit), fit_figures.KEY, above=24.0)

        return drawn(draw, ax, height=4.7)

    def residuals(self) -> Axes:
        """Draw what the law leaves over pressure, of the fit and of what was predicted."""
        return shown(fit_figures.residuals(self._fit))


class PosteriorPlots:
    """Plots of a posterior; called, it draws the tension with its bands."""

    def __init__(self, posterior: Posterior) -> None:
        self._posterior = posterior

    def __call__(self, *, ax: Axes | None = None) -> Axes:
        """Draw measured tension over length, and the 95 % band of the true tension, one per pressure."""

        def draw(axes: Axes) -> None:
            fit_figures.draw_bands(axes, self._posterior)
            style.heading(axes, fit_figures.title_of(self._posterior), fit_figures.BANDS_KEY, above=24.0)

        return drawn(draw, ax, height=4.7)

    def parameters(self) -> Axes:
        """Draw the samples of the parameters by pairs, a figure of one pair of axes per pair; the first."""
        return shown(fit_figures.parameter_pairs(self._posterior))


class ComparisonPlots:
    """Plots of a comparison of muscles; called, it draws their curves side by side."""

    def __init__(self, compared: MuscleTable) -> None:
        self._compared = compared

    def __call__(self) -> Axes:
        """Draw the curves of every muscle, a figure of one pair of axes per curve; the first.

        Raises:
            InputError: only recordings were compared, which have no law to draw.
        """
        return shown(comparison_figures.table_figure(self._compared))


class RankingPlots:
    """Plots of a ranking; called, it draws the laws with their errors."""

    def __init__(self, ranking: Ranking) -> None:
        self._ranking = ranking

    @style.styled()
    def __call__(self, *, ax: Axes | None = None) -> Axes:
        """Draw the laws in the order of their ranking with their errors of prediction, relative to the largest tension."""
        if ax is None:
            return shown(fit_figures.ranking(self._ranking))
        fit_figures.draw_ranking(ax, self._ranking, names=150.0, brief=True)
        return ax

    def curves(self, law: str | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the measured tension over length, and a fitted law through it.

        Args:
            law: its name; the best where left out.
            ax: axes to draw into.
        """
        return FitPlots(self._ranking.best if law is None else self._ranking[law])(ax=ax)

    def residuals(self, law: str | None = None) -> Axes:
        """Draw what a fitted law leaves over length, pressure and tension.

        Args:
            law: its name; the best where left out.
        """
        return FitPlots(self._ranking.best if law is None else self._ranking[law]).residuals()


class SizingPlots:
    """Plots of a sizing; called, it draws force over stroke, and the lines."""

    def __init__(self, sizing: Sizing) -> None:
        self._sizing = sizing

    @style.styled()
    def __call__(self, *, ax: Axes | None = None) -> Axes:
        """Draw force over stroke of the best muscles, and times and masses of the lines; into `ax` the first alone."""
        if ax is None:
            return shown(sizing_figures.design_map(self._sizing, law=self._sizing.law))
        sizing_figures.draw_force_over_stroke(ax, self._sizing, self._sizing.law)
        return ax


class CyclePlots:
    """Plots of working cycles; called, it draws the efficiency where curves were computed, else the loops."""

    def __init__(self, cycles: WorkingCycles) -> None:
        self._cycles = cycles

    def __call__(self) -> Axes:
        """`efficiency` if there are curves, else `loops`."""
        return self.efficiency() if self._cycles.curves else self.loops()

    def loops(self) -> Axes:
        """Piston and tendon over a cycle, a figure of two axes per cycle; the first."""
        fig = energy_figures.loops_figure(self._cycles.loops(), title=self._cycles.specimen.title)
        return shown(fig)

    def efficiency(self) -> Axes:
        """Efficiency over the pressure of the supply.

        Raises:
            InputError: the cycles were computed without ``curves=True``.
        """
        if not self._cycles.curves:
            raise InputError("curves", None, "are missing: compute the cycles with curves=True")
        lines = [energy_figures.EfficiencyLine(name, curve) for name, curve in self._cycles.curves.items()]
        return shown(energy_figures.efficiency_figure(lines, title=self._cycles.specimen.title))


class EnergyPlots:
    """Plots of an energy account; called, it draws the streams."""

    def __init__(self, account: EnergyAccount) -> None:
        self._account = account

    @style.styled()
    def __call__(self, *, ax: Axes | None = None) -> Axes:
        """Draw what enters and leaves as streams: of the gas, and magnified of the muscle; into `ax` of the gas alone."""
        if ax is None:
            return shown(energy_figures.energy_flow_figure(self._account))
        energy_figures.draw_gas_streams(ax, self._account)
        return ax


# ---- how a notebook shows an object


def muscle_html(muscle: Muscle) -> str:
    """A muscle as a table of its parameters with symbol, value, unit and source, and the braid or the force map."""
    rows = [
        (
            style.symbol_text(row.symbol, row.name.rpartition(".")[2]),
            row.meaning,
            *_value(row.value, row.unit),
            row.source,
        )
        for row in muscle.parameters()
    ]
    picture = ""
    if not muscle.is_biological:
        plots = MusclePlots(muscle)
        braid = muscle_figures.stated_braid(muscle.law, muscle.specimen)
        ax = plots.force_map() if braid is None else plots.braid()
        assert isinstance(ax, ShownAxes)
        text = ax._repr_svg_()
        picture = f"<div>{text[text.index('<svg') :]}</div>"
    return _table(muscle.title, repr(muscle), ("symbol", "meaning", "value", "unit", "source"), rows) + picture


def recording_html(recording: Recording) -> str:
    """A recording as a table of its channels with their range."""
    rows = []
    for name, s in recording.summary().items():
        low, high = (_value(s[end], s["unit"])[0] for end in ("min", "max"))
        rows.append((name, s["kind"], low, high, _unit(s["unit"]), recording.channels[name].meaning))
    head = ("channel", "kind", "lowest", "highest", "unit", "meaning")
    return _table(str(recording.meta.get("title", "Recording")), repr(recording), head, rows)


def _value(value: Any, unit: str) -> tuple[str, str]:
    numbers = [from_si(float(one), unit, shown_unit(unit)) for one in np.ravel(value)]
    return ", ".join(f"{one:.4g}" for one in numbers), _unit(unit)


def _unit(si_unit: str) -> str:
    return "" if si_unit == "1" else shown_unit(si_unit)


def _table(title: str, note: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    def cells(tag: str, words: Sequence[str]) -> str:
        return "<tr>" + "".join(f'<{tag} style="text-align:left">{html.escape(w)}</{tag}>' for w in words) + "</tr>"

    heading = f"<p><b>{html.escape(title)}</b> <code>{html.escape(note)}</code></p>" if title else ""
    return heading + (f"<table>{cells('th', head)}{''.join(cells('td', row) for row in rows)}</table>" if rows else "")
