"""The five software parts of the test machine: what acts on measured samples, watches, shows and stores them."""

from ..._lazy import lazy_submodules

lazy_submodules(__name__)
