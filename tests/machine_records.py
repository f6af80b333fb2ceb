"""Recordings as the test machine writes them, made by hand: a shipped protocol's set-points, a spring with friction."""

import numpy as np

from mckibben.experiments.read import protocol
from mckibben.recordings import Channel, Recording

REST = 0.14  # [m]
SPRING, SHORTEST, FRICTION = 0.466e-2, 0.0991, 2.5  # the nylon muscle: Kg [m], Lmin [m], and a Coulomb friction [N]
NOISE = {"pressure": 800.0, "valve_pressure": 800.0, "tension": 0.15, "span": 2e-5}  # standard deviations [SI]
WAITED = 0.7  # time after which a step with an "until" ends [s]


def machine_record(
    name: str = "quasi-static", *, noise: float = 1.0, true: bool = True, seed: int = 1, **values
) -> Recording:
    """A run of a protocol that drives pressure and span; what is not recorded leaves a gap.

    Args:
        name: of a shipped protocol.
        noise: times `NOISE`.
        true: with the channels that only a simulation has.
        seed: of the noise.
        **values: of its parameters.
    """
    done = protocol(name, **values)
    plan = done.expand(rest_length=REST)
    dt = 1.0 / plan.sample_rate
    steps, time, pressure, span, taken, counted = [], [], [], [], [], 0
    for step in plan.steps:
        count = step.count if step.until is None else min(step.count, round(WAITED / dt))
        case = {k: v if isinstance(v, str) else str(v) for k, v in step.case.items()}
        steps.append(
            {
                "index": step.index, "path": step.path, "label": step.step.label, "case": case,
                "start": counted * dt, "end": (counted + count) * dt, "recorded": step.record,
                "ended_by": "time" if step.until is None else "until", "sentence": step.step.sentence(),
            }
        )  # fmt: skip
        time.append(dt * (counted + np.arange(count)))
        pressure.append(step.pressure[:count])
        span.append(step.motor[:count])
        taken.append(np.full(count, step.record))
        counted += count
    clock, asked, place = (np.concatenate(parts) for parts in (time, pressure, span))
    keep = np.concatenate(taken)
    behind = _lagged(asked, dt / 0.02)
    pull = SPRING * behind * np.maximum(place - SHORTEST, 0.0)
    pull = np.maximum(pull + FRICTION * np.sign(np.gradient(place)) * (behind > 0.0), 0.0)
    sure = {"pressure": behind, "valve_pressure": _lagged(asked, dt / 0.008), "tension": pull, "span": place}
    chance = np.random.default_rng(seed)
    units = {"pressure": "Pa", "valve_pressure": "Pa", "tension": "N", "span": "m"}
    channels = {
        n: Channel((v + noise * NOISE[n] * chance.standard_normal(len(v)))[keep], units[n], "measured")
        for n, v in sure.items()
    }
    channels["command.pressure"] = Channel(asked[keep], "Pa", "command", "pressure asked for")
    channels["command.span"] = Channel(place[keep], "m", "command", "span asked for")
    channels["command.tension"] = Channel(np.full(keep.sum(), np.nan), "N", "command", "tension asked for")
    channels["valve.command"] = Channel(np.clip(0.2 + (asked - behind)[keep] / 1e5, 0.0, 1.0), "1", "command")
    if true:
        for n, v in (("pressure", behind), ("tension", pull), ("span", place), ("length", place)):
            channels[f"muscle.{n}"] = Channel(v[keep], {"length": "m"}.get(n) or units[n], "true")
    meta = {
        "title": done.title, "protocol": done.document(), "sentence": done.sentence(), "steps": steps,
        "rig": "simulated bench", "specimen": "nylon", "result": "done", "message": "The protocol reached its end.",
        "balance": {"mass": 2e-12, "energy": 3e-9}, "warnings": [], "citations": ["chou1996"],
        "events": [{"time": 2.7, "text": "loops began"}],
        "saturation": {"tension": {"share": 0.012, "first": 7.25, "longest": 0.031}},
    }  # fmt: skip
    return Recording(clock[keep], channels, meta)


def _lagged(values: np.ndarray, share: float) -> np.ndarray:
    """First-order lag; `share` of the way is gone in a sample."""
    from scipy.signal import lfilter

    return np.asarray(lfilter([share], [1.0, share - 1.0], values))
