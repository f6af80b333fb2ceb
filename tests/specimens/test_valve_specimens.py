"""Elements from words and from published valves: every way to state one gives the same one, and what is wrong is named."""

from pathlib import Path

import pytest

from mckibben.components.flow import GasState
from mckibben.errors import InputError
from mckibben.pneumatics.build import ELEMENTS, build_element, known_keys, valve_from_specimen
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.valves import OnOffValve, PressureRegulator, SpoolValve
from mckibben.quantities import declared, values
from mckibben.specimens import specimen, specimen_ids

TIMES = {"opening_dead_time": "3 ms", "closing_dead_time": "2 ms", "opening_time": "2 ms", "closing_time": "1 ms"}
FLOW = {"flow_into_the_room": "600 l/min", "flow_pressure": "6.9 bar"}
# One good way to state each kind.
GOOD = {
    "orifice": FLOW,
    "leak": {"flow_into_the_room": "10 ml/min", "flow_pressure": "6 bar"},
    "check_valve": FLOW | {"cracking_pressure": "0.1 bar"},
    "on_off_valve": FLOW | TIMES,
    "three_way_valve": FLOW | TIMES | {"overlap": -0.1},
    "spool_valve": FLOW | {"lag": "5 ms", "vent_flow_into_the_room": "300 l/min"},
    "pressure_regulator": FLOW | {"band": "0.2 bar", "set_pressure": "3 bar"},
    "quick_exhaust": FLOW,
    "compressor": {"displacement": "20 cm^3", "speed": "1500 rpm"},
    "linear_tube": {"resistance": "1e8 Pa*s/kg"},
    "quadratic_tube": {"length": "1 m", "diameter": "3.2 mm"},
    "inertial_tube": {"length": "1 m", "diameter": "3.2 mm", "friction": 0.03},
    "lumped_tube": {"length": "1 m", "diameter": "3.2 mm"},
}


def free_flow(orifice: Orifice, pressure: float = 6.9e5) -> float:
    """Flow to free air [l/min]."""
    return float(orifice.mass_flow(GasState(pressure + 101325.0, 293.15), GasState(101325.0, 293.15))) / 1.185 * 60e3


def refusal(kind: str, given: dict[str, object], **options: object) -> str:
    with pytest.raises(InputError) as refused:
        build_element(kind, given, where="bench.toml", **options)  # type: ignore[arg-type]
    said = str(refused.value)
    assert "\n" not in said
    assert said.startswith("bench.toml: ")
    return said


@pytest.mark.parametrize("kind", ELEMENTS)
def test_every_kind_is_built_and_names_its_keys(kind: str) -> None:
    assert type(build_element(kind, GOOD[kind])) is ELEMENTS[kind]
    assert set(declared(ELEMENTS[kind])) <= set(known_keys(kind))
    said = refusal(kind, GOOD[kind] | {"colour": "red"})
    assert f"{kind}.colour" in said
    assert all(key in said for key in known_keys(kind))


def test_a_pilot_stage_is_stated_by_both_of_its_pressures() -> None:
    rated, spring = {"pilot_rated_pressure_abs": "6 bar"}, {"pilot_spring_pressure_abs": "2.5 bar"}
    direct = build_element("on_off_valve", GOOD["on_off_valve"])
    piloted = build_element("on_off_valve", GOOD["on_off_valve"] | rated | spring)
    assert isinstance(direct, OnOffValve) and isinstance(piloted, OnOffValve)
    assert direct.pilot is None and piloted.pilot is not None
    assert values(piloted.pilot) == {"pilot_rated_pressure_abs": 6e5, "pilot_spring_pressure_abs": 2.5e5}
    assert "pilot_spring_pressure_abs is missing" in refusal("on_off_valve", GOOD["on_off_valve"] | rated)
    low = refusal("on_off_valve", GOOD["on_off_valve"] | {"pilot_rated_pressure_abs": "2 bar"} | spring)
    assert "must be above the 2.5 bar of pilot_spring_pressure_abs, got 2 bar" in low
    assert "three_way_valve has" in refusal("three_way_valve", GOOD["three_way_valve"] | rated | spring)


def test_the_ways_to_state_a_passage_agree() -> None:
    by_flow = build_element("orifice", FLOW)
    again = build_element("orifice", {"conductance": f"{float(by_flow.conductance)!r} m^3/(s*Pa)"})
    assert values(again) == pytest.approx(values(by_flow), rel=1e-12)
    assert free_flow(by_flow) == pytest.approx(600.0, rel=1e-9)
    hole = build_element("orifice", {"hole_diameter": "2 mm", "discharge": 0.9, "critical_ratio": 0.5})
    assert values(hole) == pytest.approx(values(Orifice.of_hole(2e-3, discharge=0.9, critical_ratio=0.5)))


def test_a_passage_may_differ_from_what_is_stated_for_both() -> None:
    valve = build_element("spool_valve", GOOD["spool_valve"] | {"vent_critical_ratio": 0.5})
    assert isinstance(valve, SpoolValve)
    assert (free_flow(valve.fill), free_flow(valve.vent)) == pytest.approx((600.0, 300.0))
    assert (float(valve.fill.critical_ratio), float(valve.vent.critical_ratio)) == (0.35, 0.5)
    mixed = build_element("quick_exhaust", FLOW | {"vent_hole_diameter": "4 mm"})
    assert free_flow(mixed.feed) == pytest.approx(600.0)
    assert values(mixed.vent) == pytest.approx(values(Orifice.of_hole(4e-3)))


def test_a_shaft_turns_as_often_as_it_says() -> None:
    compressor = build_element("compressor", GOOD["compressor"])
    room = GasState(101325.0, 293.15)
    flow = compressor.flows((room, room), (), 1.0, 1.0)[0]
    # 25 turns a second of 20 cm3, full at a pressure ratio of one; density of the ideal gas
    assert float(flow) == pytest.approx(25 * 20e-6 * 101325.0 / (287.05 * 293.15), rel=1e-9)


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        ("orifice", {"conductance": "1e-8 m^3/(s*Pa)", "critical_ratio": 1.2}, "orifice.critical_ratio"),
        ("orifice", {"conductance": "1e-8 m^3/(s*Pa)", "critical_ratio": "0"}, "orifice.critical_ratio"),
        (
            "orifice",
            {"hole_diameter": "-2 mm"},
            "orifice.hole_diameter must be between 0.0001 cm and 10 cm, got -0.2 cm",
        ),
        ("orifice", {"hole_diameter": "2 bar"}, "a length such as"),
        ("orifice", {"hole_diameter": 2.0}, "the unit is missing"),
        ("orifice", {"flow_into_the_room": "600 l/min"}, "orifice.flow_pressure is missing"),
        ("orifice", {}, "orifice.conductance is missing"),
        ("orifice", {"hole_diameter": "2 mm", "conductance": "1e-8 m^3/(s*Pa)"}, "exactly one of conductance"),
        ("orifice", {"hole_diameter": True}, "must be a number, or words with a unit"),
        ("orifice", {"hole_diameter": ["2 mm"]}, "must be a number, or words with a unit"),
        ("orifice", {"hole_diameter": "nan mm"}, "finite"),
        ("on_off_valve", FLOW, "on_off_valve.opening_dead_time is missing"),
        (
            "three_way_valve",
            TIMES | {"fill_flow_into_the_room": "9 l/min", "fill_flow_pressure": "6 bar"},
            "three_way_valve.vent_",
        ),
        ("spool_valve", FLOW, "spool_valve.lag is missing"),
        ("pressure_regulator", FLOW | {"band": "0 bar"}, "pressure_regulator.band"),
        ("lumped_tube", {"length": "1 m"}, "lumped_tube.diameter is missing"),
        ("inertial_tube", {"length": "1 m", "friction": 0.02}, "inertial_tube.viscous is missing"),
        ("leak", {"length": "1 cm"}, "leak.diameter is missing"),
        ("compressor", GOOD["compressor"] | {"start_pressure": "9 bar", "stop_pressure": "8 bar"}, "start_pressure"),
        ("turbine", {}, "Unknown kind 'turbine'. Known are orifice"),
    ],
)
def test_what_is_wrong_is_named(kind: str, given: dict[str, object], says: str) -> None:
    assert says in refusal(kind, given)


def test_the_papers_valves_are_what_the_paper_says() -> None:
    assert set(specimen_ids("valve")) >= {"MPP-3-1-8", "C100P-80"}
    festo, sarcos = valve_from_specimen(specimen("MPP-3-1-8")), valve_from_specimen(specimen("C100P-80"))
    assert isinstance(festo, PressureRegulator)
    assert isinstance(sarcos, SpoolValve)
    assert free_flow(festo.fill) == free_flow(festo.relief) == pytest.approx(600.0, rel=1e-9)
    assert free_flow(sarcos.fill) == pytest.approx(23.0, rel=1e-9)


def test_the_effective_flow_is_taken_only_when_asked_for_and_is_marked_inferred() -> None:
    spec = specimen("MPP-3-1-8")
    assert free_flow(valve_from_specimen(spec, effective=True).fill) == pytest.approx(95.0, rel=1e-9)
    assert {"properties.effective_flow", "valve.band", "valve.hysteresis", "valve.lag"} <= set(spec.inferred())
    assert "properties.flow_into_the_room" not in spec.inferred()
    with pytest.raises(InputError, match="effective_flow"):
        valve_from_specimen(specimen("C100P-80"), effective=True)


def test_values_go_before_the_specimens_own() -> None:
    spec = specimen("MPP-3-1-8")
    changed = build_element("pressure_regulator", {"band": "0.5 bar", "flow_into_the_room": "300 l/min"}, specimen=spec)
    assert (float(changed.band), free_flow(changed.fill)) == pytest.approx((5e4, 300.0))
    assert float(changed.hysteresis) == pytest.approx(5e3)
    other = build_element("on_off_valve", TIMES, specimen=spec)
    assert free_flow(other.passage) == pytest.approx(600.0)
    assert "pressure_regulator.colour" in refusal("pressure_regulator", {"colour": "red"}, specimen=spec)
    with pytest.raises(InputError, match="it is a muscle"):
        valve_from_specimen(specimen("nylon"))


VALVE = """\
schema = 1
id = "mine"
kind = "valve"
element = "pressure_regulator"
title = "A valve from my desk"
sources = ["me"]

[properties.flow_into_the_room]
value = 600.0
unit = "l/min"

[properties.flow_pressure]
value = 6.0
unit = "bar"

[valve.band]
value = 0.2
unit = "bar"
"""


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[valve.band]", "[valve.colour]", "Unknown field 'valve.colour'. pressure_regulator has"),
        ("value = 0.2", "value = -0.2", "valve.band"),
        ("value = 0.2", "value = [0.2, 0.3]", "valve.band"),
        ('value = 0.2\nunit = "bar"', 'value = 0.2\nunit = "cm"', "a pressure such as"),
        ('element = "pressure_regulator"', 'element = "turbine"', "Known are orifice"),
        ('element = "pressure_regulator"\n', "", "element is missing"),
        (
            '[properties.flow_into_the_room]\nvalue = 600.0\nunit = "l/min"\n',
            "",
            "the file must state a size, in [valve]",
        ),
        ('kind = "valve"', 'kind = "mckibben"', "allowed only"),
    ],
)
def test_a_valve_file_that_is_wrong_is_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert old in VALVE
    path = tmp_path / "mine.toml"
    path.write_text(VALVE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        valve_from_specimen(specimen(path))
    said = str(refused.value)
    assert "mine.toml" in said
    assert says in said
    path.write_text(VALVE, encoding="utf-8")
    assert isinstance(valve_from_specimen(specimen(path)), PressureRegulator)
