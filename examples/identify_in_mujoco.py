"""Identify parameters of a muscle inside MuJoCo, by MuJoCo's own system identification, with a known answer.

    python examples/identify_in_mujoco.py [--out FOLDER]

A mass hangs from a muscle whose valve is opened and shut. Its height is recorded with some noise; then the search begins
with other numbers. A parameter reaches the plugin through `MjSpec`, as the configuration of its instance; bounds, units and
defaults are those of the schema that the export writes. Needs a C compiler and mujoco[sysid].
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import mujoco.rollout
import numpy as np
from mujoco import sysid

import mckibben as mk
import mckibben_hosts

# Shares of the numbers of the export with which the search begins; the true ones are 1.
BEGIN = {
    "muscles.muscle.law.stiffness_per_pressure": 0.9,
    "muscles.muscle.law.threshold_pressure": 1.2,
    "circuit.elements.muscle.valve.fill.conductance": 0.7,
}
SECONDS, NOISE = 4.0, 2e-5  # of the record [s]; standard deviation of the height [m]
SENSORS = '<sensor><jointpos name="height" joint="height"/>'


def spec_of(folder: Path) -> mujoco.MjSpec:
    """The example model of the export, with a sensor of the height."""
    text = (folder / "nylon.xml").read_text()
    return mujoco.MjSpec.from_string(text.replace("<sensor>", SENSORS))


def setter(key: str, whole: float):
    """How `sysid` writes a share of a parameter into a model: as a key of the plugin's instance."""

    def set_key(spec: mujoco.MjSpec, parameter: sysid.Parameter) -> None:
        instance = spec.plugins[0]
        instance.config = {**dict(instance.config), key: repr(whole * float(parameter.value[0]))}

    return set_key


def main(folder: Path) -> dict[str, float]:
    """Print the numbers that are found, draw the motion, and return their shares of the true ones."""
    part = mckibben_hosts.Part("nylon", span="14 cm")
    plugin = mckibben_hosts.export(part, "mujoco", folder, name="nylon")[-1]
    mujoco.mj_loadPluginLibrary(str(plugin))
    schema = json.loads((folder / "nylon.schema.json").read_text())["properties"]
    spec = spec_of(folder)
    model = spec.compile()
    data = mujoco.MjData(model)
    times = np.arange(round(SECONDS / model.opt.timestep)) * model.opt.timestep
    command = np.where(
        times < 0.4, 0.15, 0.05 * np.sin(2.0 * np.pi * 0.9 * times) + 0.04 * np.sin(2.0 * np.pi * 2.3 * times)
    )
    start = sysid.create_initial_state(model, data.qpos, data.qvel, data.act)
    states, sensed = mujoco.rollout.rollout(model, data, start, command[:-1, None])
    sensed = sensed[0]
    sensed[:, 0] += NOISE * np.random.default_rng(0).standard_normal(len(sensed))
    measured = sysid.TimeSeries.from_names(states[0, :, 0], sensed, model)
    sequence = sysid.ModelSequences("weight", spec, "steps", start, sysid.TimeSeries(times, command[:, None]), measured)

    parameters = sysid.ParameterDict()
    for key, begin in BEGIN.items():
        stated = schema[key]
        whole = stated["default"]
        low, high = max(stated["minimum"] / whole, 0.3), min(stated["maximum"] / whole, 3.0)
        parameters.add(sysid.Parameter(key, 1.0, low, high, modifier=setter(key, whole)))
        parameters[key].value[:] = begin
    found, _ = sysid.optimize(
        initial_params=parameters,
        residual_fn=sysid.build_residual_fn(
            models_sequences=[sequence],
            enabled_observations=[("height", sysid.SignalType.MjSensor)],
            sensor_weights={"height": 1.0 / NOISE},
        ),
        optimizer="scipy",
        diff_step=1e-4,  # of a share: its default would drown in the noise of a float
        verbose=False,
    )
    shares = {key: float(found[key].value[0]) for key in BEGIN}
    for key, share in shares.items():
        print(f"{key}: {share * schema[key]['default']:.5g} {schema[key]['unit']}, {100.0 * (share - 1.0):+.3f} % off")
    draw(folder, spec, schema, times, command, measured.data[:, 0], shares)
    return shares


def draw(folder, spec, schema, times, command, measured, shares) -> None:
    """Draw the measured height beside the motion before and after the search."""
    figure, axes = plt.subplots(figsize=(6.4, 2.8), layout="constrained")
    axes.plot(times[1:], 1e3 * measured, color="0.7", lw=4.0, label="measured")
    for numbers, label, style in ((BEGIN, "before", "--"), (shares, "identified", "-")):
        spec.plugins[0].config = {key: repr(share * schema[key]["default"]) for key, share in numbers.items()}
        model = spec.compile()
        data, height = mujoco.MjData(model), []
        for value in command[:-1]:
            data.ctrl[0] = value
            mujoco.mj_step(model, data)
            height.append(1e3 * data.qpos[0])
        axes.plot(times[1:], height, style, lw=1.0, label=label)
    axes.set(xlabel="time (s)", ylabel="height (mm)")
    figure.legend(loc="outside upper center", ncols=3)
    mk.save_figure(figure, folder / "identify-in-mujoco.svg")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Identify a muscle in MuJoCo by MuJoCo's system identification.")
    parser.add_argument("--out", type=Path, default=Path("out"), help="Folder of the export and the figure")
    main(parser.parse_args().out)
