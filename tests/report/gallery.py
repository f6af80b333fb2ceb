"""One figure of every function that draws, from data that cost next to nothing."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

import mckibben as mk
from machine_records import machine_record
from mckibben.analysis.energy import cycle_loops, energy_curve
from mckibben.analysis.energy_parts import EnergyAccount, EnergyPart
from mckibben.analysis.frequency import FrequencyResponse
from mckibben.analysis.repeatability import Repeatability
from mckibben.analysis.segments import segments
from mckibben.identification import fit
from mckibben.identification.ranking import Ranking
from mckibben.muscles.braid import braid_of
from mckibben.muscles.build import build_law, law_from_specimen
from mckibben.recordings import Channel, ForceMap, Recording
from mckibben.report.figures import (
    analysis_figures,
    bench_diagram,
    comparison_figures,
    energy_figures,
    fit_figures,
    muscle_figures,
    recording_figures,
    run_figures,
    sizing_figures,
    study_figures,
)
from mckibben.specimens import specimen
from mckibben.studies import tube_models
from mckibben.studies.design import Design, DesignStudy
from mckibben.studies.sizing.candidate import VERDICTS
from mckibben.studies.sizing.requirements import Requirements
from mckibben_benchmark import figures as benchmark_figures
from mckibben_papers import part4
from mckibben_papers.figures import FIGURES

record = functools.cache(functools.partial(machine_record, pressure=["1 bar", "3 bar", "5 bar"]))


def at_one_bar(seed: int) -> Recording:
    """The slow loops of the lowest pressure: loops in which one thing was held."""
    return segments(record(seed=seed), label="loops")[0]


@functools.cache
def force_map() -> ForceMap:
    """A table of a known law with an error of half a newton."""
    law = build_law("ideal", {"thread_length": 0.3, "turns": 3.0})
    length, pressure = (a.ravel() for a in np.meshgrid(np.linspace(0.18, 0.25, 5), np.linspace(1e5, 5e5, 5)))
    tension = np.asarray(law.tension(length, pressure)) + 0.5 * np.sin(40.0 * np.arange(length.size))
    return ForceMap(name="made", length=length, pressure=pressure, tension=np.where(length < 0.185, 0.0, tension))


@functools.cache
def ranking() -> Ranking:
    """A fit of one law, and a published one."""
    points = force_map()
    fits = [fit("ideal", points, schemes=("pressure", "length"), train_below=3e5)]
    return Ranking("A muscle made up", None, points, fits, [("Someone, published coefficients", fits[0].error * 2.0)])


@functools.cache
def loop() -> muscle_figures.DrawnLoop:
    """A loop with friction."""
    x = np.concatenate([np.linspace(0, 0.01, 20), np.linspace(0.01, 0, 20)])
    return muscle_figures.DrawnLoop(x, 1e3 * x + np.sign(np.gradient(x)), "whole")


def simple() -> dict[str, Callable[[], Any]]:
    """Figures of laws, fits and recordings."""
    law = law_from_specimen(specimen("nylon"), "ideal")
    shape, muscle, study = braid_of(law), mk.muscle("nylon"), ranking()
    assert shape is not None
    best = study.fits[0]
    parts = segments(record(), "loops")
    return {
        "law curves": lambda: muscle_figures.law_curves(law, title="Nylon muscle"),
        "muscle": lambda: muscle_figures.muscle_drawing(shape, [0.15, 0.10], title="Nylon muscle", remarks=["long"]),
        "loop": lambda: muscle_figures.loop_figure(loop(), title="Friction", note="1 Hz"),
        "force map": lambda: muscle.plot.force_map(),
        "free length": lambda: muscle.plot.free_length(),
        "volume": lambda: muscle.plot.volume(),
        "curves": lambda: fit_figures.tension_curves(best, study.points),
        "residuals": lambda: fit_figures.residuals(best),
        "ranking": lambda: fit_figures.ranking(study),
        "correlation": lambda: fit_figures.correlation(best),
        "hold-out": lambda: fit_figures.hold_out(best),
        "overview": lambda: fit_figures.overview([study]),
        "fit curves": lambda: study.plot.curves(),
        "recording": lambda: record().plot(),
        "against": lambda: record().plot.against("span", of="loops"),
        "measured loop": lambda: at_one_bar(1).plot.loop(at_one_bar(2)),
        "swept loops": lambda: mk.plot_loops([record(), record(seed=2)], words=["one", "other"]),
        "channels against": lambda: recording_figures.against_figure(parts, "span", channels=["tension", "pressure"]),
    }


def sizing() -> Any:
    """Three muscles for a requirement, and lines for the best."""
    law = law_from_specimen(specimen("nylon"), specimen("nylon").law)

    def judged(name: str, kind: str, scale: float, verdict: str) -> Any:
        longest = 0.154
        muscle = SimpleNamespace(
            id=name, kind=kind, law=law, longest=longest, friction=2.5 * scale, error=SimpleNamespace(share=0.04)
        )
        return SimpleNamespace(
            muscle=muscle,
            verdict=verdict,
            worst=("force", -0.2),
            promised_force=62.0 * scale,
            end_force=66.0 * scale,
            largest_force=110.0 * scale,
            error_force=4.0,
            stroke=0.031 * scale,
        )

    best = judged("braid-12x180", "braid", 1.0, VERDICTS[0])
    others = (judged("nylon", "specimen", 0.9, VERDICTS[1]), judged("DMSP-10-250", "size", 0.6, VERDICTS[2]))
    lines = tuple(
        SimpleNamespace(valve=valve, element="spool_valve", tube="PUN-6x1", to_force=t, mass=m, power=w, pareto=best_of)
        for valve, t, m, w, best_of in (
            ("mpye-5-1-8-hf", 0.021, 0.33, 20.0, True),
            ("mhe2-3-2", 0.052, 0.09, 5.0, True),
            ("mpp-3-1-8", 0.19, 0.46, 7.0, False),
        )
    )
    wish = Requirements(force=50.0, stroke=0.03, pressure=5e5)
    return SimpleNamespace(wish=wish, muscles=(best, *others), chosen=best, lines=lines, law="linear_threshold")


def designs() -> DesignStudy:
    """Nine designs of two muscles."""
    rng = np.random.default_rng(0)
    rows = [
        Design("nylon" if i % 2 else "bridgestone", 0.2 + 0.1 * i, 4e-3, 5e-3, 0.01 * (i + 1), 80.0, 2e-4 * rng.random(),
               0.8, 0.2 * rng.random(), i < 5, i != 3, "")
        for i in range(9)
    ]  # fmt: skip
    return DesignStudy(tuple(rows), None, "modern")  # type: ignore[arg-type]


def tubes() -> Any:
    """Pressures behind a tube, as a delayed copy of those in front of it."""
    time = tube_models.PERIOD * np.arange(3000)

    def case(kind: str) -> Any:
        wave = np.where(time > 0.5, 5e5, 0.0) if kind == "steps" else 2.5e5 + 2e5 * np.sin(20.0 * time)
        return SimpleNamespace(
            record=SimpleNamespace(kind=kind), supply=1e5 + wave, vessel=1e5 + np.interp(time - 0.01, time, wave)
        )

    cases = (case("noise"), case("steps"))
    accumulators = (tube_models.LARGE, tube_models.SMALL)

    def result(thermal: str, model: str, accumulator: str) -> Any:
        late = 5 + 3 * study_figures.SHOWN.index(model)
        compared = [
            SimpleNamespace(predicted=np.roll(c.vessel, late), rms=2e3 * late, lead=-1e-3 * late) for c in cases
        ]
        return SimpleNamespace(comparisons=compared, rms=2e3 * late)

    return SimpleNamespace(
        thermals=("isothermal", "adiabatic", "wall_heat"),
        cases={(t, a): cases for t in ("isothermal", "adiabatic", "wall_heat") for a in accumulators},
        result=result,
    )


def efficiency() -> energy_figures.EfficiencyLine:
    """Efficiency of maximal shortening of Part IV."""
    curve = energy_curve(part4.muscle(), "maximal", np.linspace(1e5, 10e5, 61), part4.conditions())
    return energy_figures.EfficiencyLine("surroundings", curve)


def validated() -> Any:
    """Three data sets with a fitted law and a published one."""
    one = ranking().fits[0]
    other = dataclasses.replace(one, law="martens_boblan") if dataclasses.is_dataclass(one) else one
    published = SimpleNamespace(title="Linear with threshold pressure", rmse=30.0)
    return SimpleNamespace(
        static=[
            SimpleNamespace(
                of=SimpleNamespace(name=name),
                points=force_map(),
                fits=[one, other],
                unfitted=[published],
                apart=(4.0, 9.0),
                predicted=lambda law: 3.0,
            )
            for name in ("DMSP-10-250", "DMSP-20", "AARL all")
        ]
    )


def loop_study() -> Any:
    """A loop of pressure and stroke with its prediction, its width, and creep after two steps."""
    at = np.concatenate([np.linspace(0.0, 6e5, 60), np.linspace(6e5, 0.0, 60)])
    branch = np.repeat([1, -1], 60)
    stroke = 0.02 * np.sqrt(at / 6e5) - 0.001 * branch
    path = SimpleNamespace(pressure=at, stroke=stroke, branch=branch)
    unseen = SimpleNamespace(stroke=stroke + 2e-4 * np.sin(at / 5e4))
    widths = [
        SimpleNamespace(pressure=p, measured=2e-3, predicted=2.1e-3, middle=p > 1e5, error=0.05) for p in at[:60:6]
    ]
    time = np.linspace(0.1, 4.0, 40)

    def creep(segment: str) -> Any:
        held = SimpleNamespace(
            train=time < 2.0,
            time=time,
            stroke=1e-3 * np.log(time + 1.0),
            law="logarithmic",
            predict=lambda t: 1e-3 * np.log(t + 1.0),
            rmse=lambda seen: 1e-5,
        )
        return SimpleNamespace(
            segment=segment, start=0.49, fit=held, at=time, low=0.9e-3 * np.log(time + 1), high=1.1e-3 * np.log(time + 1),
            late=SimpleNamespace(time=4.0, measured=1.62e-3),
        )  # fmt: skip

    halves = (SimpleNamespace(model="dahl"), SimpleNamespace(model="bouc_wen"))
    return SimpleNamespace(
        record=path, unseen=unseen, halves=halves, widths=widths, worst=widths[3],
        steps=(creep("step_up"), creep("step_down")),
    )  # fmt: skip


def circuit_fit() -> tuple[Any, list[Any]]:
    """Four records of a tank, two of which the fit has seen."""
    time = 1e-2 * np.arange(200)
    channels = ("tank.pressure_abs", "muscle.pressure_abs")
    trials, predicted, errors = [], {}, []
    for i in range(4):
        name = f"record_{i}_with_a_name.csv"
        measured = {c: 1e5 + 3e5 * (1.0 - np.exp(-(3.0 + k + i) * time)) for k, c in enumerate(channels)}
        trials.append(SimpleNamespace(name=name, channels=channels, measured=measured, period=1e-2, samples=199))
        predicted[name] = {c: v + 2e3 * np.sin(8.0 * time) for c, v in measured.items()}
        errors += [
            SimpleNamespace(trial=name, channel=c, fitted=i < 2, rms=1.4e3, largest=2e3, lead=None) for c in channels
        ]
    return SimpleNamespace(errors=errors, predicted=predicted), trials


def circuit_run() -> Recording:
    """A recording with the channels of a circuit."""
    time = np.linspace(0.0, 2.0, 200)
    rise = 4e5 * (1.0 - np.exp(-3.0 * time))
    channels = {
        "tank.pressure": Channel(rise, "Pa"),
        "tank.mass": Channel(1e-3 * time, "kg"),
        "muscle.pressure": Channel(np.roll(rise, 4), "Pa"),
        "supply.pressure": Channel(np.full(200, 6e5), "Pa"),
        "valve.mass_flow": Channel(1e-4 * np.exp(-3.0 * time), "kg/s"),
        "tube.mass_flow": Channel(0.8e-4 * np.exp(-2.0 * time), "kg/s"),
        "muscle.tension": Channel(1e-4 * rise, "N"),
        "muscle.length": Channel(0.15 - 1e-8 * rise, "m"),
        "valve.command": Channel((time > 0.1).astype(float), "1", "command"),
        "valve.opening": Channel(np.clip(time, 0.0, 1.0), "1"),
    }
    return Recording(time, channels, {"title": "A tank and a muscle", "balance": {"mass": 1e-12, "energy": 2e-11}})


def joint_record() -> Recording:
    """A recording of a joint."""
    time = np.linspace(0.0, 2.0, 200)
    wave = 0.4 * np.sin(3.0 * time)
    channels = {
        "command.angle": Channel(wave, "rad", "command"),
        "angle": Channel(0.9 * np.roll(wave, 3), "rad", "measured"),
        "command.stiffness": Channel(np.full(200, 4.0), "N m/rad", "command"),
        "joint.stiffness": Channel(4.0 + 0.2 * wave, "N m/rad"),
        "flexor_pressure": Channel(2e5 + 1e5 * wave, "Pa", "measured"),
        "extensor_pressure": Channel(2e5 - 1e5 * wave, "Pa", "measured"),
        "moment.command": Channel((time > 1.0).astype(float), "N m", "command"),
        "loop.active": Channel((time > 0.2).astype(float), "1"),
    }
    return Recording(time, channels, {"title": "A joint with two muscles"})


def account() -> EnergyAccount:
    """An account with all usual parts."""
    parts = [
        ("supply", 12.0, "into"), ("valve", 3.1, "out"), ("tube", 0.9, "out"), ("exhaust", 3.4, "out"), ("heat", 0.6, "out"),
        ("dead_volume", 0.8, "out"), ("shaft_work", 2.2, "out"), ("friction", 0.6, "out"), ("gas", 0.3, "stored"),
        ("leak", 0.1, "out"), ("remainder", 1e-6, "remainder"),
    ]  # fmt: skip
    made = tuple(EnergyPart(name, value, side, "integral") for name, value, side in parts)
    return EnergyAccount("simulated", made, (), (), 12.0, 1e-4, {}, (), (), 1e5, lambda _: (0.0,) * 4)


def trials(name: str) -> Any:
    """Curves of a muscle side by side with others, without any protocol run."""
    biological = "fibre" in name
    at, t = np.linspace(0.55, 1.5, 40), np.linspace(-0.02, 0.3, 60)
    rise = np.clip(1.0 - np.exp(-t / 0.03), 0.0, None)
    muscle = SimpleNamespace(
        fibre=object() if biological else None,
        spec=SimpleNamespace(title="Biological muscle, fast fibres" if biological else "Nylon shell muscle"),
        full=5e5,
        full_tension=100.0,
        rest_length=0.14,
        section_area=1e-4,
    )
    curves = {
        "force_length": (at, np.clip(1.6 * (at - 0.6), 0.0, None)),
        "passive": (at, np.clip(at - 1.2, 0.0, None)),
        "stiffness": (at, 2.0 * at),
        "force_velocity": (np.linspace(0.0, 4.0, 6), np.linspace(1.0, 0.2, 6)),
        "twitch": (t, rise * np.exp(-t / 0.1)),
        "rise": (t, rise),
        "fall": (t, 1.0 - rise),
        "release": (t, 1.0 - 0.1 * rise),
        "work_loop": (1.0 + 0.1 * np.cos(20 * t), 0.5 + 0.3 * np.sin(20 * t)),
    }
    return SimpleNamespace(muscle=muscle, curves=curves)


def match() -> Any:
    """A match of a muscle to a biological one."""
    one = trials("fibre")
    names = ("force_length", "passive", "force_velocity", "twitch")
    curves = {name: one.curves[name] for name in names}
    return SimpleNamespace(
        muscle=SimpleNamespace(id="nylon"), target=SimpleNamespace(id="fast-fibre"), target_curves=curves,
        curves_before={n: (x, 0.8 * y) for n, (x, y) in curves.items()}, simulated=(np.linspace(0, 0.3, 600),) * 2,
        curves_after={n: (x, 0.95 * y) for n, (x, y) in curves.items()}, rms_before=dict.fromkeys(names, 0.2),
        rms_after=dict.fromkeys(names, 0.05),
    )  # fmt: skip


def studied() -> dict[str, Callable[[], Any]]:
    """Figures of studies, circuits, energies and joints."""
    frequency = np.geomspace(0.1, 100.0, 30)
    response = FrequencyResponse(
        frequency, 1.0 / np.hypot(1.0, frequency / 5.0), -np.arctan(frequency / 5.0), np.linspace(1.0, 0.7, 30), 8
    )
    bode = analysis_figures.BodeTitles("From the valve to the pressure", "8 segments", "bar/V")
    at = np.linspace(0.0, 1.0, 50)
    repeated = Repeatability(0.5, 1.0, 0.01, 4, at, np.stack([30 * np.sin(7 * at) + 0.3 * i for i in range(4)]))
    return {
        "sizing": lambda: sizing_figures.design_map(sizing()),
        "design front": lambda: sizing_figures.design_front(designs()),
        "tubes": lambda: study_figures.tube_figure(tubes()),
        "validation": lambda: benchmark_figures.errors_figure(validated()),
        "loop study": lambda: benchmark_figures.loop_study_figure(loop_study()),
        "circuit fit": lambda: run_figures.overview(*circuit_fit(), title="A tank behind a tube"),
        "circuit run": lambda: run_figures.run_figure(circuit_run()),
        "joint": lambda: run_figures.joint_figure(joint_record()),
        "energy flow": lambda: energy_figures.energy_flow_figure(account()),
        "cycles": lambda: energy_figures.loops_figure(
            [
                cycle_loops(part4.muscle(), name, part4.conditions(accumulator=False))
                for name in ("maximal", "isotonic")
            ],
            title="Nylon muscle",
        ),
        "efficiency": lambda: energy_figures.efficiency_figure([efficiency()], title="Nylon muscle"),
        "bode": lambda: analysis_figures.bode_figure(response, bode, cutoff=5.0),
        "repeatability": lambda: analysis_figures.repeatability_figure(
            repeated, title="Work loops", channel="Tension, N", over="Phase of the cycle"
        ),
        "comparison": lambda: comparison_figures.comparison_figure([trials("nylon"), trials("fast-fibre")], [match()]),
        "bench": lambda: bench_diagram.draw(mk.rig("modern")),
    }


def figures() -> dict[str, Callable[[], Any]]:
    """All figures by name."""
    return simple() | studied() | {f"paper {k}": FIGURES[k].draw for k in ("5a", "6a", "7a")}
