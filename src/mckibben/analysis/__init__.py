"""Numbers from laws and recordings: characteristics, loops, energy, biology. Nothing here simulates."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from .energy_accounts import energy_account as energy_account

__all__ = [
    "energy_account",
]

lazy_submodules(__name__)
lazy_names(
    __name__,
    {
        "energy_accounts": ["energy_account"],
    },
)
