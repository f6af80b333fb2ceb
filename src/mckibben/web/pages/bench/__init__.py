"""The Bench page: the test machine, drawn in the browser by ``static/js/bench.js``.

The link may name ``muscle``, ``rig``, ``protocol``, ``window`` [s], ``view`` (``edit``) and ``theme``. The page needs
nothing of NiceGUI: it lives by its socket alone, and is never built again while something moves.
"""

from __future__ import annotations

from ...shell import PAGES, document, piece


def build() -> str:
    """Build the page."""
    return document(PAGES[0], piece("bench.html"), sheets=("bench.css",), scripts=("js/bench.js",))
