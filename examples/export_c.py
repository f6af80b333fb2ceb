"""Export a muscle with gas, friction and a valve to C, control it by a program in C, and compare the motion with Python.

    python examples/export_c.py [FOLDER]

One sample of 1 ms is compiled to muscle.c and muscle.h in the folder, with a controller that calls it once per sample.
Both are compiled (this requires a C compiler) and run; the result is compared with a simulation in Python under the same
commands.
"""

import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from lanewise import lower, to_c
from mckibben.assembly import AirLine, PlateLoad, several, unit_from_specimen
from mckibben.engine import Value, held, march
from mckibben.muscles import Tendon
from mckibben.muscles.hysteresis import Dahl, FrictionLimit
from mckibben.pneumatics import InertialTube, Orifice
from mckibben.recordings import Channel, Recording
from mckibben.report.figures import style, time_figure

PERIOD, INNER, SAMPLES = 1e-3, 10, 3000  # [s], steps of the physics per sample, samples
ROOM, SUPPLY = 101325.0, 6e5  # [Pa]
NUMBERS = {"SAMPLES": SAMPLES, "PERIOD": PERIOD, "ROOM": ROOM, "SUPPLY": SUPPLY, "SHORTER": 0.13, "LONGER": 0.14}
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2"]

CONTROLLER = """\
/* Moves a muscle between two lengths, called at 1 kHz: the length sets a pressure, the pressure two valves. */
#include <stdio.h>

#include "muscle.h"

static double within(double low, double value, double high)
{
    return value < low ? low : value > high ? high : value;
}

int main(void)
{
    muscle_state state = muscle_default_state;
    muscle_memory memory = muscle_default_memory;
    muscle_inputs inputs;
    muscle_outputs outputs = {state.muscles_m_length, state.circuit_pressure_m};
    double slow = outputs.pressure_abs;

    for (int sample = 0; sample < SAMPLES; ++sample) {
        const double wanted = sample / 750 % 2 ? LONGER : SHORTER;
        const double error = outputs.length - wanted; /* too long: more air */
        slow = within(ROOM, slow + 1e8 * error * PERIOD, SUPPLY);
        const double pressure = within(ROOM, slow + 1e6 * error, SUPPLY);
        const double valve = within(-1.0, (pressure - outputs.pressure_abs) / 3e5, 1.0);
        inputs.fill = within(0.0, valve, 1.0);
        inputs.vent = within(0.0, -valve, 1.0);
        muscle(&muscle_default_parameters, &state, &memory, &inputs, &outputs);
        printf("%.17g %.17g %.17g ", wanted, inputs.fill, inputs.vent);
        printf("%.17g %.17g\\n", outputs.length, outputs.pressure_abs);
    }
    return 0;
}
"""


def machine() -> tuple[Any, Any]:
    """Build the nylon muscle with Dahl friction, two valves, a tube, and a mass on a spring, with its state at rest."""
    unit = unit_from_specimen("nylon").replace(
        friction=Dahl(limit=FrictionLimit(constant=0.5, per_pressure=4e-6), stiffness=2500.0),
        tendon=Tendon(stiffness=1500.0, slack_length=0.0, toe_length=5e-3, loss=0.2),
        end_mass=jnp.asarray(2.0),
        viscosity=jnp.asarray(5.0),
    )
    tube = InertialTube(viscous=30.0, turbulent=11.0, area=7.92e-6, length=0.5)
    line = AirLine(
        valve=(Orifice(conductance=4e-9), Orifice(conductance=5e-9)), tube=tube, port_volume=5e-6, dead_volume=1e-6
    )
    made = several({"m": unit}, PlateLoad(held=("m",), span=0.16), supply=SUPPLY, line=line)
    closed = Value(jnp.asarray(0.0), jnp.asarray(0.0))
    return made, made.initial({"m": ROOM, "m.port": ROOM}, {"m.fill": closed, "m.vent": closed})


def sample(parameters: Any, state: Any, memory: Any, inputs: Any) -> Any:
    """Integrate one sample with held commands; return state, memory and the outputs for the controller at its end."""
    signals = {f"m.{name}": held(jnp.stack([value, value])) for name, value in inputs.items()}
    (state, memory, _), kept = march(parameters, state, memory, signals, PERIOD, INNER, 1, False)
    return state, memory, {"length": kept[2]["m.length"][-1], "pressure_abs": kept[2]["m.pressure_abs"][-1]}


def main(folder: Path) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        sys.exit("This example needs a C compiler: cc, gcc or clang.")
    muscle, (state, memory) = machine()
    program, _ = lower(sample, muscle, state, memory, {"fill": 0.0, "vent": 0.0}, title="A muscle, one sample of 1 ms")
    sources = to_c(
        program, "muscle", arguments=("parameters", "state", "memory", "inputs"), results=("state", "memory", "outputs"),
        values={"parameters": jax.tree.leaves(muscle), "state": jax.tree.leaves(state), "memory": jax.tree.leaves(memory)},
    )  # fmt: skip
    sources["controller.c"] = CONTROLLER
    for name, text in sources.items():
        (folder / name).write_text(text, encoding="utf-8")
        print(f"{name}: {len(text.splitlines())} lines")

    run, numbers = folder.resolve() / "controller", [f"-D{name}={value}" for name, value in NUMBERS.items()]
    files = [str(folder / name) for name in sources if name.endswith(".c")]
    subprocess.run([compiler, *FLAGS, *numbers, *files, "-o", str(run), "-lm"], check=True)
    begin = time.perf_counter()
    printed = subprocess.run([str(run)], capture_output=True, text=True, check=True).stdout
    took = time.perf_counter() - begin
    print(f"{SAMPLES * PERIOD:.0f} s of muscle and controller computed in {1e3 * took:.0f} ms")
    wanted, fill, vent, length, pressure = np.array(printed.split(), float).reshape(-1, 5).T

    signals = {"m.fill": held(np.append(fill, 0.0)), "m.vent": held(np.append(vent, 0.0))}
    _, kept = jax.jit(march, static_argnums=(5, 6, 7))(muscle, state, memory, signals, PERIOD, INNER, SAMPLES, False)
    away = np.abs(length - kept[2]["m.length"][1:]).max()
    print(f"largest difference of the length in C and in Python: {away:.0e} m")

    channels = {
        "m.length": Channel(length, "m"),
        "wanted.length": Channel(wanted, "m", "command"),
        "m.pressure": Channel(pressure - ROOM, "Pa"),
    }
    record = Recording(PERIOD * np.arange(1, SAMPLES + 1), channels, {"title": "A muscle moved by a controller in C"})
    style.save(time_figure(record, channels=list(channels)), folder / "export-c.svg")


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    where.mkdir(exist_ok=True)
    main(where)
