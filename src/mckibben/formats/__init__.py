"""Files as plain tables of channels with units and clocks: what mckibben wrote, and what any other program did.

Nothing here knows what a recording is asked: `mckibben.recordings` makes recordings and force maps of these tables.
"""

from .._lazy import lazy_submodules

lazy_submodules(__name__)
