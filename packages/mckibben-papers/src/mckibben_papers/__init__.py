"""The papers of C.-P. Chou and B. Hannaford (1994, 1996), reproduced: every printed number and every figure beside ours.

    mckibben_papers.reproduce("IV")             the numbers of Part IV, each with our value and a verdict
    mckibben_papers.FIGURES["3a"].draw()        a figure in the paper's own form

With `import mckibben as mk` the package is `mk.papers`, and its first function `mk.reproduce`. Public names are loaded when
they are first used: the help of the command computes nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben._lazy import lazy_names, lazy_submodules
from mckibben.registry import join

if TYPE_CHECKING:
    from .figures import FIGURES as FIGURES
    from .figures import PaperFigure as PaperFigure
    from .figures import figure as figure
    from .reproduction import helped as helped
    from .reproduction import reproduce as reproduce
    from .rows import PrintedRow as PrintedRow
    from .rows import RowOutcome as RowOutcome

__version__ = "1.0.0"

join(__name__)
lazy_submodules(__name__)
lazy_names(__name__)
