"""Valves, one file each: what a command, a spring or a pressure opens."""

from .check_valve import CheckValve
from .on_off_valve import OnOffValve
from .pilot_stage import PilotStage
from .pressure_regulator import PressureRegulator
from .quick_exhaust import QuickExhaust
from .solenoid import Solenoid
from .spool_valve import SpoolValve
from .three_way_valve import ThreeWayValve

__all__ = [
    "CheckValve",
    "OnOffValve",
    "PilotStage",
    "PressureRegulator",
    "QuickExhaust",
    "Solenoid",
    "SpoolValve",
    "ThreeWayValve",
]
