"""Numbers from laws and recordings: characteristics, loops, energy, biology. Nothing here simulates."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from .description import describe_file as describe_file
    from .description import describe_recording as describe_recording
    from .energy_accounts import energy_account as energy_account
    from .frequency import channel_response as channel_response
    from .lever_answers import contraction as contraction
    from .lever_answers import work_loops as work_loops

lazy_submodules(__name__)
lazy_names(__name__)
