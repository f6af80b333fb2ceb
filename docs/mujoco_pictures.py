"""Draw the pictures of `how-to/use-a-muscle-in-mujoco.md` by MuJoCo: `MUJOCO_GL=egl python docs/mujoco_pictures.py`.

They are kept in `assets/`, since drawing needs OpenGL without a screen (EGL or OSMesa), and the build of the site does not.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import matplotlib.image
import mujoco
import numpy as np

import mckibben as mk
from mckibben_hosts import Part, export

DOCS = Path(__file__).parent
MODELS = DOCS.parent / "examples" / "mujoco"
HEIGHT, WIDTH = 560, 320  # of a pose [px]
# Model -> what happens before each pose: time [s] and commands of the valves; height of the camera and its distance [m].
POSES = {
    "elbow": (
        [[(0.1, (0.1, 0.1)), (0.4, (0, 0))], [(0.2, (0.2, -0.2)), (0.6, (0, 0))], [(0.3, (-0.3, 0.3)), (0.6, (0, 0))]],
        (-0.03, 0.95),
    ),
    "leg": (
        [
            [(0.4, (0, 0, 0, 0))],
            [(0.25, (0.15, -0.1, -0.1, 0.1))],
            [(0.8, (0, 0, 0, 0)), (0.25, (-0.15, 0.1, 0.15, -0.15)), (0.2, (0, 0, 0, 0))],
        ],
        (0.84, 1.75),
    ),
}


def picture(name: str) -> np.ndarray:
    """Poses of a model beside each other."""
    poses, (height, distance) = POSES[name]
    model = mujoco.MjModel.from_xml_path(str(MODELS / f"{name}.xml"))
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (0.02, 0.0, height), distance, 90, -6
    drawn = []
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        for pieces in poses:
            for seconds, commands in pieces:
                data.ctrl[:] = commands
                mujoco.mj_step(model, data, nstep=round(seconds / model.opt.timestep))
            renderer.update_scene(data, camera)
            drawn.append(renderer.render().copy())
    return np.concatenate(drawn, axis=1)


def main() -> None:
    """Build the plugins and draw both models."""
    with tempfile.TemporaryDirectory() as folder:
        parts = {
            "nylon": Part("nylon", mk.Air(supply="6 bar"), span="14 cm"),
            "leg": Part.from_circuit(MODELS / "leg.toml"),
        }
        for name, part in parts.items():
            mujoco.mj_loadPluginLibrary(str(export(part, "mujoco", Path(folder, name), name=name)[-1]))
        for name in POSES:
            matplotlib.image.imsave(DOCS / "assets" / f"mujoco-{name}.png", picture(name))


if __name__ == "__main__":
    main()
