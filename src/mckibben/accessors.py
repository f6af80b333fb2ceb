"""What an object offers and a room above its own carries out: one table of it, and its objects loaded when first used.

A muscle has a ``plot`` and a recording an ``energy``, although `muscles` and `recordings` import neither figures nor
analysis. `PLACES` is the only table of a lower room that names upper ones, and this module the only one that the order of
the rooms exempts. It holds what people ask of an object they have, and nothing that a room needs to compute: figures
(``muscle.plot``), what a notebook shows of an answer, written documents, questions to a recording, the run of a circuit,
and the readings that a muscle is calibrated by.
"""

from __future__ import annotations

import functools
import importlib
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

if TYPE_CHECKING:  # types of what a lower room offers, which its annotations take from here
    from .analysis.energy_parts import EnergyAccount as EnergyAccount
    from .analysis.frequency import ChannelResponse as ChannelResponse
    from .analysis.lever import ContractionTiming as ContractionTiming
    from .analysis.lever import LeverLoop as LeverLoop
    from .analysis.lever import StimulatedContraction as StimulatedContraction
    from .analysis.lever import StimulatedLoop as StimulatedLoop
    from .analysis.loops import TensionLoop as TensionLoop
    from .analysis.questions import HeldPressure as HeldPressure
    from .analysis.questions import RecordingNumbers as RecordingNumbers
    from .analysis.repeatability import CourseRepeatability as CourseRepeatability
    from .analysis.steps import StepResponse as StepResponse
    from .report.figures.plots import ComparisonPlots as ComparisonPlots
    from .report.figures.plots import CyclePlots as CyclePlots
    from .report.figures.plots import EnergyPlots as EnergyPlots
    from .report.figures.plots import FitPlots as FitPlots
    from .report.figures.plots import MusclePlots as MusclePlots
    from .report.figures.plots import PosteriorPlots as PosteriorPlots
    from .report.figures.plots import RankingPlots as RankingPlots
    from .report.figures.plots import RecordingPlots as RecordingPlots
    from .report.figures.plots import SizingPlots as SizingPlots

T = TypeVar("T")
FIGURES = (
    "report.figures.plots:ComparisonPlots",
    "report.figures.plots:CyclePlots",
    "report.figures.plots:EnergyPlots",
    "report.figures.plots:FitPlots",
    "report.figures.plots:MusclePlots",
    "report.figures.plots:PosteriorPlots",
    "report.figures.plots:RankingPlots",
    "report.figures.plots:RecordingPlots",
    "report.figures.plots:SizingPlots",
)
PAGES = (  # of a notebook
    "report.figures.plots:muscle_html",
    "report.figures.plots:recording_html",
)
DOCUMENTS = (
    "report.fit_report:write_fit_report",
    "report.study_reports:muscle_comparison",
    "report.study_reports:write_characterisation_report",
    "report.study_reports:write_data_sheet",
)
QUESTIONS = (  # to a recording
    "analysis.description:describe_file",
    "analysis.energy_accounts:energy_account",
    "analysis.frequency:channel_response",
    "analysis.lever:contraction_timing",
    "analysis.lever:lever_loops",
    "analysis.lever:stimulated_contractions",
    "analysis.lever:stimulated_loops",
    "analysis.loops:force_map",
    "analysis.questions:leak",
    "analysis.questions:loops",
    "analysis.questions:steps",
    "analysis.questions:stiffness",
    "analysis.questions:work",
    "analysis.repeatability:repeatability",
    "analysis.segments:segments",
)
RUNS = ("bench.circuit_run:run_circuit",)
READINGS = ("identification.calibration:calibrate", "identification.calibration:new_muscle")  # of a muscle
PLACES = {
    place.partition(":")[2]: place for place in (*FIGURES, *PAGES, *DOCUMENTS, *QUESTIONS, *RUNS, *READINGS)
}  # by name


@functools.cache
def implementation(name: str) -> Any:
    """The object that carries out what a lower room offers, its module loaded.

    Args:
        name: of it in `PLACES`.
    """
    module, _, attribute = PLACES[name].partition(":")
    return getattr(importlib.import_module(f"{__package__}.{module}"), attribute)


class Accessor(Generic[T]):
    """An attribute that is an object about its owner: a class of `PLACES`, called with the owner.

    Args:
        name: of the class, see `implementation`.
    """

    def __init__(self, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, owner: None, kind: type) -> Accessor[T]: ...
    @overload
    def __get__(self, owner: object, kind: type) -> T: ...
    def __get__(self, owner: object, kind: type) -> Accessor[T] | T:
        """The object about the owner; the accessor itself where the owner is a class."""
        if owner is None:
            return self
        about: T = implementation(self.name)(owner)
        return about
