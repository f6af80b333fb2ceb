"""Pictures of a mechanism with its muscles at a moment of a simulation, to scale, as pixels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...quantities import from_si
from ...simulation import Chain, Joint, Plate, Simulation, Weight
from ...simulation.mechanisms import in_si, published
from . import style
from .muscle_figures import draw_braid, stated_braid
from .style import COLOURS, INK, INK_2, INK_3, SUNKEN, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 4.8  # width and height of a picture [inch]
DPI = 100
THREADS = 6  # drawn in each direction
FITTING = 6e-3  # length of an end fitting [m]
PLAIN = 0.012  # diameter of a muscle without a braid [m]
ANCHOR = 0.175  # of a muscle from the joint that it turns [m]
FULL = 6e5  # gauge pressure at which the gas is drawn darkest [Pa]


class PointInPicture(NamedTuple):
    """A point [m], and the direction of a part that begins there, counter-clockwise from straight down [rad]."""

    x: float
    y: float
    direction: float

    def at(self, across: float, along: float) -> tuple[float, float]:
        """A point beside the part: to the side of positive angles, and along it [m]."""
        sine, cosine = math.sin(self.direction), math.cos(self.direction)
        return self.x + across * cosine + along * sine, self.y + across * sine - along * cosine


class MechanismPicture:
    """Pictures of what moves in a simulation: a weight, a plate, a joint or a chain of joints."""

    def __init__(self, simulation: Simulation, title: str = "") -> None:
        self.system, self.title = simulation.system, title
        self.shapes = {
            name: stated_braid(unit.law, published(simulation.system.muscles[name]))
            for name, unit in simulation.units.items()
        }

    @style.styled()
    def frame(self, readings: Mapping[str, float], wanted: Mapping[str, float], time: float) -> np.ndarray:
        """Draw a moment.

        Args:
            readings: fields of the simulation's observation.
            wanted: goals, by field of the observation.
            time: since the start [s].

        Returns:
            Pixels, red, green and blue, (480, 480, 3) of bytes.
        """
        fig = style.drawing(SIZE, SIZE)
        fig.set_dpi(DPI)
        ax = fig.add_axes((0.0, 0.0, 1.0, 1.0))
        ax.set_axis_off()
        left, bottom, size = self._window()
        ax.set_xlim(left, left + size)
        ax.set_ylim(bottom, bottom + size)
        self._point = size / (72.0 * SIZE)
        if isinstance(self.system, Weight):
            hook = -readings["position"] - 2.0 * FITTING
            _hatched(ax, (-0.05, 0.0), (0.05, 0.0), 0.008)
            self._draw_muscle(ax, "muscle", PointInPicture(0.0, 0.0, 0.0), 0.0, -hook, readings)
            _box(ax, (-0.03, hook - 0.05), 0.06, 0.05, SUNKEN)
            if "position" in wanted:
                ax.plot(
                    [-0.06, 0.06],
                    [-wanted["position"] - 2.0 * FITTING] * 2,
                    color=COLOURS["length"],
                    lw=1.4,
                    ls=(0, (4, 2.3)),
                    zorder=8,
                )
        elif isinstance(self.system, Joint):
            self._draw_joint(ax, readings, wanted)
        elif isinstance(self.system, Chain):
            self._draw_chain(ax, readings, wanted, self.system)
        elif isinstance(self.system, Plate):
            _hatched(ax, (0.0, -0.04), (0.0, 0.04), -0.008)
            self._draw_muscle(
                ax, "muscle", PointInPicture(0.0, 0.0, 0.5 * math.pi), 0.0, readings["span"] + 2.0 * FITTING, readings
            )
            _box(ax, (readings["span"] + 2.0 * FITTING, -0.03), 0.008, 0.06, INK_3)
            low, tall = -0.095, 0.04
            _box(ax, (0.05, low), 0.012, tall, "none")
            _box(ax, (0.05, low), 0.012, tall * min(max(readings["pressure"] / FULL, 0.0), 1.0), COLOURS["pressure"])
            if "pressure" in wanted:
                level = low + tall * wanted["pressure"] / FULL
                ax.plot([0.044, 0.068], [level] * 2, color=INK, lw=1.6, zorder=8)
        ax.text(0.03, 0.965, self.title, transform=ax.transAxes, fontweight="bold", fontsize=style.SMALL, va="center")
        said = [
            f"{name.replace('_', ' ')} {_shown(name, readings[name])}, wanted {_shown(name, value)}"
            for name, value in wanted.items()
        ]
        lines = [f"{time:.2f} s", *said]
        for k, line in enumerate(lines):
            ax.text(
                0.03, 0.925 - 0.035 * k, line, transform=ax.transAxes, fontsize=style.SMALL, color=INK_2, va="center"
            )
        fig.canvas.draw()
        return np.asarray(fig.canvas.buffer_rgba())[..., :3].copy()  # type: ignore[attr-defined]

    def _window(self) -> tuple[float, float, float]:
        """Left and lower edge, and size of the picture [m]."""
        if isinstance(self.system, Chain):
            reach = sum(in_si(link.length, "m", "length") for link in self.system.links)
            size = (reach + ANCHOR + 0.03) / 0.81
            return -0.5 * size, -reach - 0.03, size
        if isinstance(self.system, Joint):
            return -0.21, -0.165, 0.42
        return (-0.15, -0.25, 0.30) if isinstance(self.system, Weight) else (-0.05, -0.125, 0.25)

    def _draw_joint(self, ax: Axes, readings: Mapping[str, float], wanted: Mapping[str, float]) -> None:
        arms = _arms(self.system)
        _hatched(ax, (-0.05, ANCHOR), (0.05, ANCHOR), 0.008)
        if "angle" in wanted:
            place = PointInPicture(0.0, 0.0, wanted["angle"])
            x, y = place.at(0.0, 0.13)
            ax.plot([place.x, x], [place.y, y], color=COLOURS["length"], lw=1.6, ls=(0, (4, 2.3)), zorder=2)
        self._draw_hinge(
            ax,
            PointInPicture(0.0, 0.0, 0.0),
            readings["angle"],
            arms,
            {"flexor": "flexor", "extensor": "extensor"},
            readings,
        )
        _limb(ax, PointInPicture(0.0, 0.0, readings["angle"]), 0.13)

    def _draw_chain(self, ax: Axes, readings: Mapping[str, float], wanted: Mapping[str, float], chain: Chain) -> None:
        _hatched(ax, (-0.05, ANCHOR), (0.05, ANCHOR), 0.008)
        place = PointInPicture(0.0, 0.0, 0.0)
        for k, link in enumerate(chain.links, 1):
            muscles = {side: f"{side}_{k}" for side in ("flexor", "extensor") if f"{side}_{k}" in self.shapes}
            angle, length = readings[f"angle_{k}"], in_si(link.length, "m", "length")
            self._draw_hinge(ax, place, angle, _arms(link), muscles, readings)
            limb = PointInPicture(place.x, place.y, place.direction + angle)
            _limb(ax, limb, length)
            place = PointInPicture(*limb.at(0.0, length), limb.direction)
        if {"tip_across", "tip_height"} <= set(wanted):
            goal = wanted["tip_across"], wanted["tip_height"]
            ax.plot(*goal, "o", ms=13.0, mfc="none", mec=COLOURS["length"], mew=1.8, zorder=9)
        ax.plot(place.x, place.y, "o", ms=5.0, color=INK, zorder=9)

    def _draw_hinge(
        self,
        ax: Axes,
        base: PointInPicture,
        angle: float,
        arms: tuple[float, float],
        muscles: Mapping[str, str],
        readings: Any,
    ) -> None:
        from matplotlib.patches import Circle

        for side, arm in zip(("flexor", "extensor"), arms, strict=True):
            if side not in muscles:
                continue
            across = arm if side == "flexor" else -arm
            top = PointInPicture(*base.at(across, -ANCHOR), base.direction)
            self._draw_muscle(ax, muscles[side], top, 0.0, ANCHOR, readings)
            turned = np.linspace(0.5 * math.pi * math.copysign(1.0, across), angle, 25)
            round_it = [PointInPicture(base.x, base.y, base.direction + one).at(0.0, arm) for one in turned]
            ax.plot(*zip(*round_it, strict=True), color=INK, lw=1.2, zorder=4)
        ax.add_patch(Circle((base.x, base.y), 0.96 * min(arms), fc=SUNKEN, ec=INK_3, lw=0.9, zorder=3))

    def _draw_muscle(
        self, ax: Axes, name: str, place: PointInPicture, begin: float, end: float, readings: Mapping[str, float]
    ) -> None:
        """A muscle that hangs at a place, and the cord from its lower end on [m]."""
        from matplotlib.patches import Rectangle
        from matplotlib.transforms import Affine2D

        prefix = f"{name}_" if len(self.shapes) > 1 else ""
        length, pressure = float(readings[f"{prefix}length"]), float(readings[f"{prefix}pressure"])
        local = Affine2D().rotate(place.direction - 0.5 * math.pi).translate(place.x, place.y) + ax.transData
        slack = float(readings[f"{prefix}tension"]) <= 0.0
        length = min(length, end - begin - 2.0 * FITTING)  # a slack muscle sags, which is not drawn
        last = begin + FITTING + length + FITTING
        ax.plot(
            [last, max(end, last)], [0.0, 0.0], color=INK, lw=1.2, ls=":" if slack else "-", zorder=4, transform=local
        )
        start = begin + FITTING
        shape = self.shapes[name]
        known = shape is not None and length < 0.999 * shape.thread_length
        width = shape.diameter(length) if shape is not None and known else PLAIN
        if shape is not None and known:
            clamp = 0.8 * shape.diameter(0.98 * shape.thread_length)
            draw_braid(ax, shape, length, (start, 0.0), FITTING, clamp, THREADS, self._point, local)
        else:
            ax.add_patch(Rectangle((start, -0.5 * width), length, width, fc=SUNKEN, ec=INK, transform=local, zorder=2))
        shade = 0.55 * min(max(pressure / FULL, 0.0), 1.0)
        gas = Rectangle((start, -0.5 * width), length, width, fc=COLOURS["pressure"], ec="none", alpha=shade)
        gas.set(transform=local, zorder=3.5)
        ax.add_patch(gas)


def _arms(joint: Any) -> tuple[float, float]:
    """Moment arms of flexor and extensor at angle zero, without their signs [m]."""
    pair = joint.arm if isinstance(joint.arm, tuple | list) else (joint.arm, joint.arm)
    sizes = [abs(float(one.arm(0.0))) if hasattr(one, "arm") else in_si(one, "m", "arm") for one in pair]
    return sizes[0], sizes[1]


def _shown(name: str, value: float) -> str:
    if "pressure" in name:
        return f"{number(from_si(value, 'Pa', 'bar'), 2)} bar"
    if "angle" in name:
        return f"{number(math.degrees(value), 1)}°"
    return f"{number(from_si(value, 'm', 'cm'), 2)} cm"


def _hatched(ax: Axes, begin: tuple[float, float], end: tuple[float, float], depth: float) -> None:
    """The ground: a line with hatches behind it, above a horizontal one and left of a vertical one for a negative depth."""
    from matplotlib.patches import Rectangle

    width, height = end[0] - begin[0], end[1] - begin[1]
    size = (width, depth) if height == 0.0 else (depth, height)
    ax.add_patch(Rectangle(begin, *size, fc="none", ec=INK_3, lw=0, hatch="////", zorder=1))
    ax.plot([begin[0], end[0]], [begin[1], end[1]], color=INK, lw=1.6, zorder=6)


def _box(ax: Axes, corner: tuple[float, float], width: float, height: float, colour: str) -> None:
    from matplotlib.patches import Rectangle

    ax.add_patch(Rectangle(corner, width, height, fc=colour, ec=INK, lw=0.9, zorder=6))


def _limb(ax: Axes, place: PointInPicture, length: float) -> None:
    x, y = place.at(0.0, length)
    ax.plot([place.x, x], [place.y, y], color=INK_3, lw=7.0, solid_capstyle="round", zorder=2.5, alpha=0.8)
    ax.plot(place.x, place.y, "o", ms=4.5, color=INK, zorder=7)
