"""The web interface: one server, eight pages, one state; `workspace` is that state, `server` serves it."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names

if TYPE_CHECKING:
    from .charts import Axis as Axis
    from .charts import Chart as Chart
    from .charts import ChartLine as ChartLine
    from .charts import update as update
    from .elements import PageDocument as PageDocument
    from .widgets import panel as panel
    from .widgets import select as select

lazy_names(__name__)
