"""What a run is divided into and begins with, beside stand-ins for its steps: nothing is built here."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from mckibben.bench import prepare as module
from mckibben.bench.prepare import (
    RunSegment,
    _segments,
    changes_by_owner,
    prepare_on_machine,
    with_friction_scale,
)
from mckibben.errors import InputError
from mckibben.experiments.protocol import Reach


@dataclass(frozen=True)
class Protocol:
    """A protocol as far as its rate is asked for."""

    sample_rate: float


@dataclass(frozen=True)
class Prepared:
    """A prepared run as far as it is changed for a machine that is sampled already."""

    protocol: Protocol
    plan: SimpleNamespace
    findings: tuple[str, ...]
    rig: SimpleNamespace
    every: int = 1
    motor_held: bool = False


def step(motor=(0.14, 0.14), mode="span", ask="", before=(0.13, 0.13), pressure=(2e5, 2e5)):
    return SimpleNamespace(
        motor=np.array(motor) if isinstance(motor, tuple) else motor,
        mode=mode,
        step=SimpleNamespace(ask=ask),
        motor_before=Reach(*before),
        pressure_before=Reach(*pressure),
        span=Reach(0.11, 0.15),
    )


def segment(*steps, **more):
    return RunSegment(steps, "direct", 1.0, "", **more)


@pytest.mark.parametrize(
    ("steps", "held", "moves", "begins"),
    [
        ([step()], False, False, 0.14),
        ([step()], True, True, 0.13),
        ([step(), step(motor=(0.14, 0.15))], False, True, 0.13),
        ([step(), step(motor=(0.15, 0.15))], False, True, 0.13),
        ([step(), step(mode="tension")], False, True, 0.13),
        ([step(), step(motor="deferred")], False, True, 0.13),
        ([step(mode="tension")], False, True, 0.11),
        ([step(motor=(0.14, 0.15), before=(0.1, 0.2))], False, True, 0.11),
    ],
)
def test_a_muscle_whose_end_never_moves_stands_on_a_plate_where_its_set_points_are(steps, held, moves, begins):
    one = segment(*steps, motor_held=held)
    assert one.moves is moves and one.start_span == begins


def test_a_segment_begins_at_the_pressure_before_it_or_without_one_that_is_known():
    assert segment(step()).start_pressure == 2e5
    assert segment(step(pressure=(1e5, 2e5))).start_pressure == 0.0


def test_a_plan_is_divided_where_the_operator_acts_and_what_was_changed_stays():
    hands = {
        "oil it": SimpleNamespace(plumbing="", friction=0.5),
        "join": SimpleNamespace(plumbing="other", friction=1.0),
    }
    rig = SimpleNamespace(operator_action=hands.get)
    steps = [step(), step(), step(ask="oil it"), step(ask="wave"), step(), step(ask="join")]
    parts = list(_segments(rig, SimpleNamespace(steps=steps), "direct", True))
    assert [len(part.steps) for part in parts] == [2, 1, 2, 1] and all(part.motor_held for part in parts)
    assert [(part.layout, part.friction, part.asked) for part in parts] == [
        ("direct", 1.0, ""),
        ("direct", 0.5, "oil it"),
        ("direct", 0.5, "wave"),  # of which the rig knows nothing
        ("other", 1.0, "join"),
    ]
    (first,) = _segments(rig, SimpleNamespace(steps=steps[2:3]), "direct")
    assert first.asked == "oil it" and not first.motor_held, "no empty segment before the first action"


def test_changes_are_of_the_rig_the_muscle_or_the_protocol_by_the_first_word_of_their_path():
    changes = {
        "rig.plumbing.direct.tube.length": 1.0,
        "muscle.law.gain": 2.0,
        "pressure": 3.0,
        "rig": 4.0,
        "steps.1.for": 5.0,
    }
    assert changes_by_owner(changes) == (
        {"plumbing.direct.tube.length": 1.0},
        {"law.gain": 2.0},
        {"pressure": 3.0, "rig": 4.0, "steps.1.for": 5.0},
    )


def test_a_lubricant_changes_the_friction_that_there_is_and_nothing_where_its_factor_is_one():
    calls = []
    friction = SimpleNamespace(lubricated=lambda factor: calls.append(factor) or "less")
    unit = SimpleNamespace(friction=friction, replace=lambda **of: of)
    assert with_friction_scale(unit, 0.5) == {"friction": "less"} and calls == [0.5]
    assert with_friction_scale(unit, 1.0) is unit
    with pytest.raises(InputError, match="has none that a lubricant could change"):
        with_friction_scale(SimpleNamespace(friction=None), 0.5)


@pytest.mark.parametrize(
    ("own", "planned", "findings", "every", "again"),
    [
        (1000.0, 1000.0, (), 1, False),
        (250.0, 250.0, (), 4, True),
        (250.0, 1000.0, (), 1, False),  # the loop of the protocol is as fast already
        (250.0, 250.0, ("a finding",), 1, False),
    ],
)
def test_on_a_machine_that_is_sampled_already_a_slower_protocol_is_recorded_at_its_own_rate(
    own, planned, findings, every, again, monkeypatch
):
    asked = []

    def prepare(protocol, **options):
        asked.append((protocol, options))
        rate = planned if isinstance(protocol, str) else protocol.sample_rate
        named = Protocol(own) if isinstance(protocol, str) else protocol
        return Prepared(named, SimpleNamespace(sample_rate=rate), findings, SimpleNamespace(motor="m"))

    monkeypatch.setattr(module, "prepare", prepare)
    found = prepare_on_machine("p", 1000.0, seed=3)
    assert len(asked) == 1 + again and all(options == {"seed": 3} for _, options in asked)
    assert (found.every, found.motor_held, found.protocol.sample_rate) == (every, True, own)
    assert found.plan.sample_rate == (1000.0 if again else planned)
    for rate in (1000.01, 999.99, 0.4 * own):
        if abs(rate / own - round(rate / own)) > 1e-6 or rate < own:
            with pytest.raises(InputError, match="at which the session samples, or a whole part of it"):
                prepare_on_machine("p", rate, seed=3)
