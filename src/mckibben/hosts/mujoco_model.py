"""Models of MuJoCo for the scenarios: a mass on a tendon, or a hinge between two muscles at gears."""

from __future__ import annotations

from .scenarios import Scenario

NO_RESET = '<flag autoreset="disable"/>'  # a mass that is too small is to be seen, not set back


def model_text(
    scenario: Scenario, period: float, *, actuators: str, extension: str = "", sensors: str = "", flags: str = NO_RESET
) -> str:
    """The text of a model.

    Args:
        scenario: the scenario.
        period: of the steps [s].
        actuators: elements of the muscles.
        extension: element that names a plugin.
        sensors: element of the sensors.
        flags: elements of the options.
    """
    mechanism = scenario.mechanism
    inertia = repr(mechanism.inertia)
    if mechanism.rotary:
        all_axes = " ".join([inertia] * 3)
        limb = f'<inertial pos="0 0 0" mass="1" diaginertia="{all_axes}"/>'
        body = f'<joint name="q" type="hinge" axis="0 1 0"/>{limb}'
        tendon = ""
    else:
        ball = f'<inertial pos="0 0 0" mass="{inertia}" diaginertia="1 1 1"/>'
        body = f'<joint name="q" type="slide" axis="0 0 -1"/>{ball}<site name="hook"/>'
        tendon = '<tendon><spatial name="cord"><site site="anchor"/><site site="hook"/></spatial></tendon>'
    return f"""<mujoco><option timestep="{period!r}" gravity="0 0 0">{flags}</option>
{extension}
<worldbody><site name="anchor"/><body>{body}</body></worldbody>{tendon}
<actuator>{actuators}</actuator>{sensors}</mujoco>"""


def pulled_ends(scenario: Scenario) -> dict[str, str]:
    """What each muscle pulls at, as attributes of its actuator, in the order of the part."""
    mechanism = scenario.mechanism
    return {
        name: f'joint="q" gear="{-mechanism.arms[name]!r}"' if mechanism.rotary else 'tendon="cord"'
        for name in scenario.part.muscles
    }
