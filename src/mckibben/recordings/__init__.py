"""Recordings and force maps, measured and simulated: read from files of any format, kept, and corrected."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from ..formats.labels import COLUMNS as COLUMNS
    from ..formats.labels import TIMES as TIMES
    from ..formats.live_log import LiveLog as LiveLog
    from ..formats.table import Channel as Channel
    from ..formats.table import FileFormat as FileFormat
    from ..formats.table import ForeignColumn as ForeignColumn
    from ..formats.table import ForeignTable as ForeignTable
    from .calibration import saturated as saturated
    from .files import FileReading as FileReading
    from .files import convert as convert
    from .files import read as read
    from .files import read_any as read_any
    from .files import read_record as read_record
    from .files import read_recording as read_recording
    from .files import understand as understand
    from .files import write as write
    from .force_map import ForceMap as ForceMap
    from .force_map import read_force_map as read_force_map
    from .recording import Note as Note
    from .recording import Recording as Recording

lazy_submodules(__name__)
lazy_names(__name__)
