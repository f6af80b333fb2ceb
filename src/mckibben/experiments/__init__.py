"""What to do: waveforms and protocols, as data."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from .amounts import CHANNELS as CHANNELS
    from .amounts import Amount as Amount
    from .amounts import read_amount as read_amount
    from .commands import COMMANDS as COMMANDS
    from .commands import Command as Command
    from .commands import known_set_points as known_set_points
    from .read import build_protocol as build_protocol
    from .read import parse_protocol as parse_protocol

lazy_submodules(__name__)
lazy_names(__name__)
