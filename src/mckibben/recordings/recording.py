"""The recording: what happened, as channels over one time.

It separates production from evaluation: simulation or hardware produce it, and nothing that evaluates it knows which.
Values of its channels are in SI units, to which any other unit is converted.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from ..accessors import Accessor, implementation
from ..answers import Caution
from ..documents import JsonValue, write_whole
from ..errors import InputError
from ..extras import library
from ..formats.registry import writer_of
from ..formats.sidecar import file_attributes
from ..formats.table import KINDS, Channel, channel_attributes, check_samples
from .provenance import cautions_of

if TYPE_CHECKING:
    import pandas
    import xarray

    from ..accessors import (
        ChannelResponse,
        ContractionTiming,
        CourseRepeatability,
        EnergyAccount,
        HeldPressure,
        LeverLoop,
        RecordingNumbers,
        RecordingPlots,
        StepResponse,
        StimulatedContraction,
        StimulatedLoop,
        TensionLoop,
    )
    from .force_map import ForceMap


SAVED = (".nc", ".csv")  # suffixes that `Recording.save` takes: they hold all that a recording has
LONGEST_NOTE = 200  # characters
LISTED = 6  # channels named in one line
# Of a uniform clock; beyond, a period in the wrong unit is meant.
_MOST_SAMPLES = 10**8


class Note(NamedTuple):
    """A note: time of the recording [s], and text."""

    time: float
    text: str


def notes_of(meta: Mapping[str, JsonValue]) -> list[Note]:
    """The notes of a recording's meta by time; what is none is passed over."""
    listed = meta.get("notes")
    notes = []
    for item in listed if isinstance(listed, list) else []:
        time, text = (item.get(k) for k in ("time", "text")) if isinstance(item, Mapping) else (None, None)
        if (
            isinstance(time, int | float)
            and not isinstance(time, bool)
            and math.isfinite(time)
            and isinstance(text, str)
        ):
            notes.append(Note(float(time), text))
    return sorted(notes)


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Channels over a common time, and metadata of the run. Immutable; every method returns a new one.

    Args:
        time: (n,) [s], finite and strictly increasing, n at least 1.
        channels: by dotted name such as ``tank.pressure``; a pressure is gauge unless the name ends in ``_abs``.
        meta: what JSON can hold, nested. Writers use title, created, result, message, circuit, parameters, specimen,
            protocol, rig, environment, versions, citations, balance, events. NaN and infinities survive files.

    Raises:
        InputError: names the channel, the value and what is allowed.

    Examples:
        >>> import mckibben as mk
        >>> recording = mk.Recording([0.0, 0.1], {"tank.pressure": mk.Channel([1e5, 2e5], "Pa")})
        >>> recording
        Recording(2 samples, 0 s to 0.1 s: tank.pressure)
        >>> recording.to_dataframe().index.name
        'time'
    """

    time: np.ndarray
    channels: Mapping[str, Channel]
    meta: Mapping[str, Any] = field(default_factory=dict)

    plot: ClassVar[Accessor[RecordingPlots]] = Accessor("RecordingPlots")

    def __post_init__(self) -> None:
        check_samples(self)

    def __len__(self) -> int:
        return len(self.time)

    def __contains__(self, name: object) -> bool:
        return name in self.channels

    # Its length is in samples: a walk over names would not fit to that.
    __iter__ = None

    def __getitem__(self, name: str) -> np.ndarray:
        """Values of a channel (n,) [its unit], or the time under ``"time"``."""
        return self.time if name == "time" else self._channel(name).values

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Recording):
            return NotImplemented
        same = np.array_equal(self.time, other.time) and dict(self.channels) == dict(other.channels)
        return same and _comparable(self.meta) == _comparable(other.meta)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        span = f"{self.time[0]:.6g} s to {self.time[-1]:.6g} s"
        names = [*self.channels]
        listed = ", ".join(names if len(names) <= LISTED else [*names[: LISTED - 1], f".. {len(names)} channels"])
        count = len(self.cautions)
        said = f"; {count} caution{'s' if count > 1 else ''}" if count else ""
        return f"Recording({len(self)} samples, {span}: {listed or 'no channels'}{said})"

    @property
    def cautions(self) -> tuple[Caution, ...]:
        """What must be known before the samples are used: lost or late ones, saturation, warnings, what a file left out."""
        return cautions_of(self.meta)

    def _channel(self, name: str) -> Channel:
        try:
            return self.channels[name]
        except (KeyError, TypeError):
            raise InputError("channel", name, "the recording has", known=self.channels) from None

    def names(self, kind: str | None = None) -> list[str]:
        """Names of the channels, of one kind if given, in their order."""
        if kind is not None and kind not in KINDS:
            raise InputError("kind", kind, known=KINDS)
        return [name for name, channel in self.channels.items() if kind in (None, channel.kind)]

    def unit(self, name: str) -> str:
        """SI unit of a channel."""
        return "s" if name == "time" else self._channel(name).unit

    @property
    def period(self) -> float:
        """Median interval between samples [s]."""
        if len(self) < 2:
            raise InputError("period", None, f"needs 2 samples or more, got {len(self)}")
        return float(np.median(np.diff(self.time)))

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.time[-1] - self.time[0])

    def select(self, start: float | None = None, end: float | None = None) -> Recording:
        """Samples from `start` to `end` [s], inclusive; an omitted end is open. Times are unchanged."""
        low, high = -math.inf if start is None else float(start), math.inf if end is None else float(end)
        # Times are sums of periods: 0.30000000000000004 s is meant by 0.3 s.
        room = 1e-6 * self.period if len(self) > 1 else 0.0
        keep = (self.time >= low - room) & (self.time <= high + room)
        if not keep.any():
            known = f"the recording has {self.time[0]:.6g} s to {self.time[-1]:.6g} s"
            raise InputError("select", None, f"from {low:.6g} s to {high:.6g} s holds no sample; {known}")
        some = {name: channel.with_values(channel.values[keep]) for name, channel in self.channels.items()}
        return Recording(self.time[keep], some, self.meta)

    @property
    def runs(self) -> tuple[Recording, ...]:
        """The runs that a file of another program holds one after another, each on its own clock; else this one alone.

        Examples:
            >>> import mckibben as mk
            >>> begins = [{"start": 0.0, "end": 1.0, "began": 0.0}, {"start": 2.0, "end": 3.0, "began": 0.0}]
            >>> pulls = mk.Channel([1.0, 2.0, 1.0, 3.0], "N")
            >>> both = mk.Recording([0.0, 1.0, 2.0, 3.0], {"tension": pulls}, {"runs": begins})
            >>> [float(run["tension"][-1]) for run in both.runs]
            [2.0, 3.0]
        """
        stated = self.meta.get("runs")
        if not isinstance(stated, list) or len(stated) < 2:
            return (self,)
        meta = {name: value for name, value in self.meta.items() if name != "runs"}
        runs = []
        for one in stated:
            part = self.select(one["start"], one["end"])
            runs.append(Recording(part.time - one["start"] + one["began"], part.channels, meta))
        return tuple(runs)

    def pick(self, names: Iterable[str]) -> Recording:
        """Some channels, in the order given."""
        if isinstance(names, str):
            raise InputError("names", names, "must be a list of names")
        return Recording(self.time, {name: self._channel(name) for name in names}, self.meta)

    def with_channels(self, channels: Mapping[str, Channel]) -> Recording:
        """Return a copy with channels added or replaced."""
        return Recording(self.time, {**self.channels, **channels}, self.meta)

    def with_meta(self, meta: Mapping[str, JsonValue] | None = None, /, **more: object) -> Recording:
        """Return a copy with metadata added or replaced."""
        return Recording(self.time, self.channels, {**self.meta, **(meta or {}), **more})

    def uniform(self, period: float | None = None) -> Recording:
        """Interpolate linearly to a uniform clock; the start is kept, nothing is extrapolated.

        It smooths nothing: a period much above the old one folds what is faster than it.

        Args:
            period: period of the new clock [s]; the median interval where it is left out.
        """
        step = self.period if period is None else float(period)
        if not (math.isfinite(step) and 0.0 < step and self.duration <= step * _MOST_SAMPLES):
            raise InputError("period", step, f"must be a time [s] above {self.duration / _MOST_SAMPLES:.3g}")
        count = math.floor(self.duration / step * (1.0 + 1e-12) + 1e-9) + 1
        time = self.time[0] + step * np.arange(count)
        moved = {n: c.with_values(np.interp(time, self.time, c.values)) for n, c in self.channels.items()}
        return Recording(time, moved, self.meta)

    def summary(self) -> dict[str, dict[str, JsonValue]]:
        """Statistics of each channel: min, max, mean of the samples [its unit], unit and kind. NaN are ignored."""
        figures_of: dict[str, dict[str, Any]] = {}
        for name, channel in self.channels.items():
            known = channel.values[~np.isnan(channel.values)]
            figures = (known.min(), known.max(), known.mean()) if known.size else (math.nan,) * 3
            numbers = dict(zip(("min", "max", "mean"), map(float, figures), strict=True))
            figures_of[name] = {**numbers, "unit": channel.unit, "kind": channel.kind}
        return figures_of

    @property
    def notes(self) -> list[Note]:
        """Notes by time, from the metadata; invalid ones are skipped."""
        return notes_of(self.meta)

    def with_note(self, time: float, text: str) -> Recording:
        """Return the recording with one more note.

        Args:
            time: within the recording [s].
            text: one line.

        Raises:
            InputError: the time lies outside, or the text is no line.
        """
        words = text.strip()
        if not words or len(words) > LONGEST_NOTE or not words.isprintable():
            shown = words[:40] + (".." if len(words) > 40 else "")
            raise InputError("note", shown, f"must be one line of 1 to {LONGEST_NOTE} characters")
        first, last = float(self.time[0]), float(self.time[-1])
        if not first <= time <= last:
            raise InputError(
                "time of a note", None, f"must be between {first:.6g} s and {last:.6g} s, got {time:.6g} s"
            )
        return self._with_notes(sorted([*self.notes, Note(float(time), words)]))

    def without_note(self, note: Note) -> Recording:
        """The recording without a note."""
        return self._with_notes([other for other in self.notes if other != note])

    def _with_notes(self, notes: list[Note]) -> Recording:
        return self.with_meta(notes=[note._asdict() for note in notes])

    def to_xarray(self) -> xarray.Dataset:
        """The recording as an xarray dataset: coordinate ``time`` [s], a variable per channel, the metadata as attributes.

        Raises:
            MissingLibraryError: xarray is not installed.
        """
        xr = library("xarray", "Datasets need")
        time = ("time", self.time, {"units": "s", "long_name": "time"})
        variables = {name: ("time", c.values, channel_attributes(name, c)) for name, c in self.channels.items()}
        dataset: xarray.Dataset = xr.Dataset(variables, coords={"time": time}, attrs=file_attributes(self.meta))
        return dataset

    def to_dataframe(self) -> pandas.DataFrame:
        """The recording as a data frame: index ``time`` [s], a column per channel [SI], the meta as `attrs`.

        Raises:
            MissingLibraryError: pandas is not installed; it comes with the extra ``data``.
        """
        pd = library("pandas", "Data frames need")
        frame: pandas.DataFrame = pd.DataFrame(
            {name: channel.values for name, channel in self.channels.items()}, index=pd.Index(self.time, name="time")
        )
        frame.attrs.update(file_attributes(self.meta))
        return frame

    def segments(self, label: str | None = None, /, **case: object) -> list[Recording]:
        """The recorded steps of the protocol that match, each a recording with its step in ``meta["step"]``.

        Args:
            label: label of the step; any where it is left out.
            **case: what was varied, such as ``pressure="5 bar"``; a number is in SI.

        Raises:
            InputError: the recording has no steps, or none that match; names those that it has.
        """
        parts: list[Recording] = implementation("segments")(self, label, **case)
        return parts

    def loops(
        self, *, length: str | None = None, tension: str | None = None, skip: int = 0, **options: object
    ) -> RecordingNumbers[TensionLoop]:
        """The loop of tension over length of every full cycle of every run: its work, friction and stiffness.

        What is answered is a sequence of the loops, with tables, medians, ranges and cautions; so are `work`, `stiffness`,
        `steps` and `leak`. Channels that are not named are found by name and unit, and the answer says which they are.

        Args:
            length: name of the driven channel [m].
            tension: name of the other [N].
            skip: cycles left out at the beginning, such as the first after rest, whose history is another.
            **options: ``start`` and ``end`` [s] of `analysis.questions.loops`.

        Raises:
            InputError: a channel is missing, not clear or not finite, or there is no full cycle.

        Examples:
            >>> import numpy as np
            >>> import mckibben as mk
            >>> time = np.linspace(0.0, 2.0, 401)
            >>> swing = np.sin(2.0 * np.pi * time)
            >>> channels = {"span": mk.Channel(0.12 + 0.01 * swing, "m"), "pull": mk.Channel(30.0 + 5.0 * swing, "N")}
            >>> len(mk.Recording(time, channels).loops())
            1
        """
        each: RecordingNumbers[TensionLoop] = implementation("loops")(
            self, length=length, tension=tension, skip=skip, **options
        )
        return each

    def work(self, **options: object) -> RecordingNumbers[float]:
        """Work and power of every cycle, or of the whole way where there is no cycle [J], [W].

        Args:
            **options: ``length``, ``tension``, ``skip``, ``start`` and ``end`` of `analysis.questions.work`.
        """
        each: RecordingNumbers[float] = implementation("work")(self, **options)
        return each

    def stiffness(self, **options: object) -> RecordingNumbers[float]:
        """Stiffness about the middle of every loop, or of one pull [N/m].

        Args:
            **options: ``length``, ``tension``, ``skip``, ``start`` and ``end`` of `analysis.questions.stiffness`.
        """
        each: RecordingNumbers[float] = implementation("stiffness")(self, **options)
        return each

    def steps(self, **options: object) -> RecordingNumbers[StepResponse]:
        """Delay, rise and settling of pressure and tension after every step of a command, or of a stimulus [s].

        Args:
            **options: ``command``, ``channel``, ``start`` and ``end`` of `analysis.questions.steps`.
        """
        each: RecordingNumbers[StepResponse] = implementation("steps")(self, **options)
        return each

    def leak(self, **options: object) -> RecordingNumbers[HeldPressure]:
        """Fall of the pressure of a shut muscle, with the pressure at which it holds [Pa/s], and the air [m^3/s].

        Args:
            **options: ``pressure``, ``gas_volume``, ``start`` and ``end`` of `analysis.questions.leak`.
        """
        each: RecordingNumbers[HeldPressure] = implementation("leak")(self, **options)
        return each

    def frequency(self, **options: object) -> ChannelResponse:
        """Frequency response between two channels.

        Args:
            **options: ``source``, ``target``, ``resolution``, ``sines``, ``start`` and ``end`` of
                `analysis.frequency.channel_response`.
        """
        response: ChannelResponse = implementation("channel_response")(self, **options)
        return response

    def repeatability(self, **options: object) -> CourseRepeatability:
        """How well the cycles of this recording, or its runs where it has several, repeat each other.

        Args:
            **options: ``channel``, ``drive``, ``skip``, ``start`` and ``end`` of `analysis.repeatability.repeatability`.
        """
        courses: CourseRepeatability = implementation("repeatability")(self, **options)
        return courses

    def contraction_timing(
        self, *, rising: Sequence[float] = (0.1, 0.9), relaxing: Sequence[float] | None = None, above: str = "rest"
    ) -> ContractionTiming:
        """Time the stimulus, the peak and set points of a twitch or tetanus of a muscle on a lever.

        Args:
            rising: shares of the development of force at which the rise is timed, 0 to 1.
            relaxing: the same for the relaxation; by default 0.9 and 0.5, and none of a tetanus.
            above: ``rest``, the force at the stimulus, or ``zero``, from which shares count.

        Raises:
            InputError: a channel is missing, there is no stimulus, or the force does not rise after it.
        """
        timing: ContractionTiming = implementation("contraction_timing")(
            self, rising=rising, relaxing=relaxing, above=above
        )
        return timing

    def lever_loops(
        self, *, cut: str = "L0", keep: Sequence[int] | None = None, frequency: float | None = None
    ) -> tuple[LeverLoop, ...]:
        """Compute work and power of the cycles of a muscle on a lever.

        Args:
            cut: where a cycle begins and ends: ``L0``, ``peak`` or ``trough`` of the length.
            keep: numbers of the cycles, from 1 on; all by default.
            frequency: of the cycles [1/s]; by default that of the file's protocol.

        Raises:
            InputError: a channel is missing, no frequency is stated, or there is no whole cycle.
        """
        each: tuple[LeverLoop, ...] = implementation("lever_loops")(self, cut=cut, keep=keep, frequency=frequency)
        return each

    def stimulated_contractions(self) -> tuple[StimulatedContraction, ...]:
        """The contraction in every step with stimulation at constant length: peak, times, mean and ripple.

        Raises:
            InputError: a channel is missing or not finite, or nothing was stimulated at constant length.
        """
        each: tuple[StimulatedContraction, ...] = implementation("stimulated_contractions")(self)
        return each

    def stimulated_loops(self) -> tuple[StimulatedLoop, ...]:
        """The mean work loop of every step whose length cycles while the muscle is stimulated: net work and power.

        Raises:
            InputError: a channel is missing or not finite, or no step has full cycles.
        """
        each: tuple[StimulatedLoop, ...] = implementation("stimulated_loops")(self)
        return each

    def force_map(
        self,
        lengths: Iterable[float],
        *,
        of: str | None = None,
        length: str = "span",
        tension: str = "tension",
        pressure: str = "pressure",
        skip: int = 0,
    ) -> ForceMap:
        """The force map of slow loops at constant pressures: the mean of both branches, which leaves friction out.

        Args:
            lengths: where to read the branches [m].
            of: label of the steps with the loops; all recorded ones where left out.
            length: name of the driven channel [m].
            tension: name of the tension [N].
            pressure: name of the gauge pressure [Pa].
            skip: cycles left out at the beginning of each step.

        Raises:
            InputError: a channel or step is missing, there is no full cycle, or a length is not reached on both branches.
        """
        points: ForceMap = implementation("force_map")(
            self, [*lengths], of=of, length=length, tension=tension, pressure=pressure, skip=skip
        )
        return points

    def energy(self, **options: object) -> EnergyAccount:
        """The energy balance: what the supply gave, what became work, and where the rest went [J].

        Args:
            **options: ``start``, ``end`` [s], ``cycle`` and ``measured`` of `analysis.energy_accounts.energy_account`.

        Raises:
            InputError: names the channel or the parameter that the balance needs and the recording lacks.
        """
        account: EnergyAccount = implementation("energy_account")(self, **options)
        return account

    def _repr_html_(self) -> str:
        return str(implementation("recording_html")(self))

    def save(self, path: str | Path) -> Path:
        """Write to a ``.nc`` (netCDF) or ``.csv`` file, atomically.

        Returns:
            The path written.

        Raises:
            InputError: the suffix is unknown, or the file cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() not in SAVED:
            raise InputError("suffix", path.suffix or str(path), known=SAVED, where=str(path))
        write = writer_of(path).write
        assert write is not None
        return write_whole(path, lambda part: write(self, part))


def _comparable(meta: Mapping[str, JsonValue]) -> str:
    # As text, in which one NaN equals another.
    return json.dumps(meta, sort_keys=True)
