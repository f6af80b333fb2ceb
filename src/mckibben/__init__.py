"""McKibben pneumatic artificial muscles: laws, air, test bench, identification, reports.

    import mckibben as mk

Everything a user needs hangs on this one name; `PUBLIC` lists it in groups. The import is light: the module behind a name is
loaded when the name is first used. Packages that are installed by themselves hang on it too, such as ``mckibben.hosts``.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from ._lazy import lazy_submodules, public_names
from ._version import __version__ as __version__

if TYPE_CHECKING:
    from .analysis.energy.working_cycles import energy as energy
    from .assembly.check import check as check
    from .assembly.circuit_file import read_circuit as circuit  # noqa: F401
    from .bench.rig_file import rig as rig
    from .bench.run import prepare as prepare
    from .bench.run import run as run
    from .bench.session import Session as Session
    from .errors import InputError as InputError
    from .errors import MckibbenError as MckibbenError
    from .experiments.read import protocol as protocol
    from .identification.fit import Fit as Fit
    from .identification.fit import fit_all as fit_all
    from .identification.ranking import Ranking as Ranking
    from .identification.ranking import fit as fit
    from .muscles import Muscle as Muscle
    from .muscles import PressureLaw as PressureLaw
    from .muscles import TensionLaw as TensionLaw
    from .muscles.build import law as law
    from .muscles.muscle import muscle as muscle
    from .quantities import quantity as quantity
    from .recordings import Channel as Channel
    from .recordings import ForceMap as ForceMap
    from .recordings import Recording as Recording
    from .recordings import read as read
    from .recordings import read_force_map as read_force_map
    from .recordings import read_recording as read_recording
    from .report.figures.formats import figure_style as figure_style
    from .report.figures.plots import plot_loops as plot_loops
    from .report.figures.style import save_figure as save_figure
    from .simulation import Air as Air
    from .simulation import Chain as Chain
    from .simulation import Joint as Joint
    from .simulation import Link as Link
    from .simulation import Plate as Plate
    from .simulation import Simulation as Simulation
    from .simulation import Spring as Spring
    from .simulation import Weight as Weight
    from .specimens import Specimen as Specimen
    from .specimens import specimen as specimen
    from .studies.characterisation.verb import characterise as characterise
    from .studies.comparison import compare as compare
    from .studies.diagnosis.fault_fit import diagnose as diagnose
    from .studies.parts import part as part
    from .studies.parts import parts as parts
    from .studies.sizing.size import size as size

# The public names by subject; where each is, type checkers read above.
PUBLIC = {
    "Muscles and laws": "muscle, Muscle, PressureLaw, TensionLaw, law, quantity, check, Specimen, specimen".split(", "),
    "Measured data": "read, ForceMap, read_force_map, Fit, fit, fit_all, Ranking".split(", "),
    "Systems that one steps": "Simulation, Joint, Chain, Link, Weight, Spring, Plate, Air".split(", "),
    "Experiments": "protocol, rig, prepare, run, Session, circuit, Channel, Recording, read_recording".split(", "),
    "Questions": "parts, part, size, compare, energy, characterise, diagnose, reproduce, benchmark".split(", "),
    "Figures": "figure_style, save_figure, plot_loops".split(", "),
    "Errors": "InputError, MckibbenError".split(", "),
}
# Where each is loaded from when it is first used; in brackets the extra of a package that is installed by itself.
_SOURCES = public_names(__name__) | {"reproduce": "[papers]", "benchmark": "[benchmark]"}
__all__ = ["__version__", *(name for group in PUBLIC.values() for name in group)]  # noqa: PLE0604
lazy_submodules(__name__)  # before `__getattr__`, which it would ask for each of them


def __getattr__(name: str) -> Any:
    """Load the module behind a public name when the name is first used."""
    source = _SOURCES.get(name, f"[{name}]")
    if source.startswith("["):
        # not with this package, whose import is to be light
        registry = importlib.import_module(".registry", __name__)
        if (extra := source.strip("[]")) not in registry.PACKAGES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value = registry.announced("mckibben.names", name, extra, f"{__name__}.{name} needs")
        return value
    if name in ("read", "read_recording"):
        importlib.import_module(".isolation", __name__).start("mckibben.formats.registry")
    module, _, attribute = source.partition(":")
    value = getattr(importlib.import_module(module, __name__), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, for completion."""
    return sorted(__all__)
