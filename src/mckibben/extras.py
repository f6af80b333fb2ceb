"""Optional libraries: an error names the extra that installs a missing one.

Ask before the work begins: a person who has waited for a minute does not want to hear of a library then.
"""

from __future__ import annotations

import importlib
from types import ModuleType

from .errors import MissingLibraryError

# Library in Python -> its extra, and its name for pip.
LIBRARIES = {
    "asammdf": ("mdf", "asammdf"),
    "dask": ("sweep", "dask"),
    "distributed": ("sweep", "distributed"),
    "edfio": ("formats", "edfio"),
    "ezc3d": ("formats", "ezc3d"),
    "gymnasium": ("gym", "gymnasium"),
    "fmpy": ("fmi", "fmpy"),
    "libcosimpy": ("libcosim", "libcosimpy"),
    "grpc": ("daq", "nidaqmx[grpc]"),
    "mujoco": ("mujoco", "mujoco"),
    "mujoco_warp": ("warp", "mujoco-warp"),
    "newton": ("warp", "newton"),
    "nidaqmx": ("daq", "nidaqmx[grpc]"),
    "nptdms": ("formats", "npTDMS"),
    "opensim": ("opensim", "opensim"),
    "pandas": ("data", "pandas"),
    "polars": ("formats", "polars"),
    "mcap_protobuf": ("formats", "mcap-protobuf-support"),
    "pydrake": ("drake", "drake"),
    "pymatreader": ("formats", "pymatreader"),
    "python_calamine": ("formats", "python-calamine"),
    "rosbags": ("formats", "rosbags"),
    "numpyro": ("posterior", "numpyro"),
    "ophyd_async": ("bluesky", "ophyd-async"),
    "serial": ("serial", "pyserial"),
    "starlette": ("web", "starlette"),
    "typst": ("report", "typst"),
    "uvicorn": ("web", "uvicorn"),
    "warp": ("warp", "warp-lang"),
    "websockets": ("web", "websockets"),
    "xarray": ("data", "xarray"),
    "zarr": ("sweep", "zarr"),
}


def library(module: str, purpose: str, *, instead: str = "", where: str | None = None) -> ModuleType:
    """Import an optional library, or a module of it.

    Args:
        module: its name in Python, such as ``"nidaqmx.errors"``; the first word must be in `LIBRARIES`.
        purpose: what needs it, with the verb, such as ``"TDMS files need"``.
        instead: what does without it, as an imperative.
        where: the file or option that asks for it.

    Raises:
        MissingLibraryError: it is not installed.
    """
    extra, package = LIBRARIES[module.split(".")[0]]
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingLibraryError(purpose, package, extra, instead=instead, where=where) from None
