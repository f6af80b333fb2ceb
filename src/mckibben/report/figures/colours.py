"""The colours of figures, reports and the web interface, light and dark.

Colour is data: five hues stand for five quantities, and everything else is ink on paper. The names are those of the CSS
custom properties, ``--ink`` and so on, by which a page re-colours a figure; style sheets use them and define no colours.
"""

from __future__ import annotations

from collections.abc import Mapping

LIGHT = {
    "paper": "#f2f3f0", "panel": "#fcfcfa", "sunken": "#e9ebe7", "raised": "#ffffff",
    "rule": "#d9dcd7", "edge": "#7a817b", "ink": "#14181b", "ink-2": "#454d51", "ink-3": "#5c6468",
    "on-ink": "#fcfcfa", "grid": "#e6e8e4", "hatch": "#c9cdc8", "tint": "rgba(20,24,27,.05)",
    "q-pressure": "#1f5ce0", "q-tension": "#a34700", "q-length": "#00735c", "q-flow": "#6a1b84", "q-valve": "#353e47",
    "q-pressure-fill": "rgba(31,92,224,.13)", "q-tension-fill": "rgba(163,71,0,.13)",
    "q-length-fill": "rgba(0,115,92,.12)", "q-flow-fill": "rgba(106,27,132,.11)", "q-valve-fill": "rgba(53,62,71,.10)",
    "stop": "#cf1b24", "on-stop": "#ffffff", "stop-ring": "#e8b400", "stop-fill": "#fbe6e5", "stop-ink": "#a20f17",
    "caution": "#8a5a00", "caution-fill": "#fff1cc", "caution-edge": "#b98300",
    "shadow": "0 1px 2px rgba(20,24,27,.10),0 8px 24px rgba(20,24,27,.12)",
}  # fmt: skip
DARK = {
    "paper": "#101315", "panel": "#171b1e", "sunken": "#20262a", "raised": "#1e2428",
    "rule": "#2b3237", "edge": "#707a81", "ink": "#edf0f0", "ink-2": "#bcc4c8", "ink-3": "#98a2a7",
    "on-ink": "#101315", "grid": "#242b2f", "hatch": "#3a4349", "tint": "rgba(237,240,240,.06)",
    "q-pressure": "#4795ff", "q-tension": "#f28c3f", "q-length": "#4de0b4", "q-flow": "#f5b0f2", "q-valve": "#9aa5ae",
    "q-pressure-fill": "rgba(71,149,255,.20)", "q-tension-fill": "rgba(242,140,63,.18)",
    "q-length-fill": "rgba(77,224,180,.14)", "q-flow-fill": "rgba(245,176,242,.14)",
    "q-valve-fill": "rgba(154,165,174,.16)",
    "stop": "#d6242b", "on-stop": "#ffffff", "stop-ring": "#e8b400", "stop-fill": "#3a1719", "stop-ink": "#ff9b98",
    "caution": "#f2c14e", "caution-fill": "#352a10", "caution-edge": "#a47f1f",
    "shadow": "0 1px 2px rgba(0,0,0,.5),0 10px 30px rgba(0,0,0,.5)",
}  # fmt: skip


def style_sheet(media: str = "all") -> str:
    """Return the colours as CSS custom properties of the root element.

    Light is the default. Dark follows the system, or the attribute ``data-theme`` of the root element.

    Args:
        media: type of media in which dark applies; ``screen`` keeps printed pages light.
    """
    light, dark = _declarations("light", LIGHT), _declarations("dark", DARK)
    return (
        f":root{{{light}}}@media {media} and (prefers-color-scheme:dark){{:root:not([data-theme=light]){{{dark}}}}}"
        f":root[data-theme=dark]{{{dark}}}"
    )


def _declarations(scheme: str, colours: Mapping[str, str]) -> str:
    return f"color-scheme:{scheme};" + "".join(f"--{name}:{value};" for name, value in colours.items())
