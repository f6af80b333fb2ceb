"""Real test machines, behind a microcontroller or a data acquisition card: connection, commissioning, calibration.

session = mckibben.bench.session.proxy.SessionProxy("serial:/dev/ttyACM0", "paper", "nylon")
devices = mckibben_hardware.bench_devices(session)

With `import mckibben as mk` the package is `mk.hardware`. It adds the machines ``serial`` and ``daq`` of `--on`, and the
commands ``device`` and ``calibrate``. Its public names and modules are loaded when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben._lazy import lazy_names, lazy_submodules
from mckibben.registry import join

if TYPE_CHECKING:
    from .bluesky import bench_devices as bench_devices
    from .calibrate import CalibrationSession as CalibrationSession
    from .commissioning import check_machine as check_machine
    from .daq import DaqHardware as DaqHardware
    from .serial_line import SerialHardware as SerialHardware

__version__ = "1.0.0"

join(__name__)
lazy_submodules(__name__)
lazy_names(__name__)
