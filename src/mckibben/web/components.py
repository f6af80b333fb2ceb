"""Elements of NiceGUI whose browser side is a function and no text: text never becomes code on these pages.

NiceGUI compiles the templates of its components in the browser, and evaluates handlers and calls that it is given as text.
The policy of the pages (`guard.POLICY`) forbids all of it. What they need instead stands here and in ``static/js/page.js``:
components with a render function, events that carry a value, and calls of functions by name.
"""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nicegui.element import Element


@functools.cache
def markup_type() -> type[Any]:
    """HTML in an element of any tag; made when the first page is, since NiceGUI takes a while to load."""
    from nicegui import ui

    class Markup(ui.html, component="static/components/markup.js"):
        pass

    return Markup


@functools.cache
def file_picker_type() -> type[Any]:
    """A place that uploads the files it is given."""
    from nicegui import ui

    class FilePicker(ui.upload, component="static/components/file_picker.js"):
        pass

    return FilePicker


def on_value(element: Element, event: str, do: Callable[[Any], Any], throttle: float = 0.0) -> None:
    """Listen to an event of an element, with what the browser says of it as ``args``.

    Args:
        element: a field, or one that a script of ``static/js`` sends events to.
        event: ``lab-change``, ``lab-input`` and ``lab-enter`` of a field, with its value; or one of a script.
        do: given the event.
        throttle: shortest time between two of them [s].
    """

    def came(given: Any) -> Any:
        return do(dataclasses.replace(given, args=given.args["detail"]))

    element.on(event, came, args=["detail"], throttle=throttle)


def call(name: str, *given: Any) -> None:
    """Call a function of the page by its name in ``static/js/page.js``, with anything that JSON holds."""
    from nicegui import ui

    ui.run_javascript(f"{name}({', '.join(json.dumps(one) for one in given)})")
