"""What to do: waveforms and protocols, as data."""

from .._lazy import lazy_submodules

lazy_submodules(__name__)
