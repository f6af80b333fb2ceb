"""Figures and reports. Only `report.figures` draws."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from .blocks import Cite as Cite
    from .blocks import Figure as Figure
    from .blocks import Paragraph as Paragraph
    from .blocks import References as References
    from .blocks import ReportTable as ReportTable
    from .blocks import Section as Section
    from .blocks import TableColumn as TableColumn
    from .blocks import TableRow as TableRow
    from .document import Document as Document

lazy_submodules(__name__)
lazy_names(__name__)
