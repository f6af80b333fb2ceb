"""A gauge of a table's cell as a small SVG picture."""

from __future__ import annotations

import html

from .document import Gauge, printable

WIDTH, HEIGHT, HALF = 120, 14, 48  # of the picture, and of its scale from 0 to 1 [px]
# Of the house: ink for what is ours, grey for what is allowed; names are the page's own properties.
_COLOURS = {"ink": "#14181b", "edge": "#7a817b", "rule": "#d9dcd7"}


def gauge_svg(gauge: Gauge, *, recoloured: bool = False) -> str:
    """The picture as an SVG element.

    Args:
        gauge: what it shows.
        recoloured: in the colours of the page around it, light or dark.
    """
    colour = {k: f"var(--{k})" if recoloured else v for k, v in _COLOURS.items()}
    parts = []
    if gauge.band is not None:
        low, high = (_x(max(-1.0, min(1.0, end))) for end in gauge.band)
        parts.append(f'<rect x="{low:.1f}" y="4" width="{high - low:.1f}" height="6" fill="{colour["rule"]}"/>')
    ruled = "".join(f"M{_x(at):.1f} 1V13" for at in gauge.ruled)
    if ruled:
        parts.append(f'<path d="{ruled}" stroke="{colour["rule"]}" fill="none"/>')
    if gauge.tick is not None:
        parts.append(f'<path d="M{_x(gauge.tick):.1f} 1V13" stroke="{colour["edge"]}" stroke-width="1.5" fill="none"/>')
    if gauge.whisker is not None:
        ends = "".join(_end(at, side) for at, side in zip(gauge.whisker, (-1, 1), strict=True))
        low, high = (_x(max(-1.0, min(1.0, at))) for at in gauge.whisker)
        line = f"M{low:.1f} 7H{high:.1f}{ends}"
        parts.append(f'<path d="{line}" stroke="{colour["ink"]}" stroke-width="1.3" fill="none"/>')
    parts.append(_dot(gauge.dot, colour["ink"]))
    label = html.escape(printable(gauge.label), quote=True)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'role="img" aria-label="{label}">{"".join(parts)}</svg>'
    )


def _x(place: float) -> float:
    return WIDTH / 2.0 + HALF * place


def _end(at: float, side: int) -> str:
    if abs(at) <= 1.0:
        return f"M{_x(at):.1f} 3V11"
    tip = _x(side * 1.14)
    return f"M{tip - 5.0 * side:.1f} 3L{tip:.1f} 7L{tip - 5.0 * side:.1f} 11"


def _dot(at: float, ink: str) -> str:
    if abs(at) <= 1.0:
        return f'<circle cx="{_x(at):.1f}" cy="7" r="3" fill="{ink}"/>'
    side = 1 if at > 0.0 else -1
    tip = _x(side * 1.18)
    back = tip - 7.0 * side
    return f'<path d="M{tip:.1f} 7L{back:.1f} 3V11Z" fill="{ink}"/>'
