"""Numbers from laws and recordings: characteristics, loops, energy, biology. Nothing here simulates."""

from .._lazy import lazy_submodules

lazy_submodules(__name__)
