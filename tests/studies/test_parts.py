"""The catalogue of parts says what the files of parts state, in SI; its names are those that other commands take."""

import pytest

import mckibben as mk
from mckibben.citations import known_keys
from mckibben.components import Environment
from mckibben.errors import InputError
from mckibben.muscles.laws import LAWS
from mckibben.pneumatics.build import build_element
from mckibben.simulation import Air
from mckibben.specimens import specimen_ids
from mckibben.specimens.parts import parts as published
from mckibben.studies.parts import COLUMNS, KINDS, list_parts, part, part_of_specimen, rows_of

EVERY = list_parts()


def test_every_part_that_ships_is_listed_once():
    ids = [one.id for one in EVERY]
    assert len(ids) == len(set(ids))
    shipped = {
        *specimen_ids(),
        *(name for name in LAWS if LAWS[name].__module__.startswith("mckibben.")),  # others are of tests
        *(p.id for kind in ("tube", "gas_source", "fluidic_muscle") for p in published(kind)),
    }
    assert set(ids) == shipped


def test_every_number_has_a_source_or_says_that_it_is_inferred():
    known = set(known_keys())
    for one in EVERY:
        if one.kind != "laws":
            for n in one.numbers:
                assert n.inferred or n.source in known, (one.id, n.name)
                assert n.value is not None and n.unit, (one.id, n.name)
                assert n.low is None or n.low <= n.value <= n.high, (one.id, n.name)


def test_a_flow_into_the_room_is_compared_as_a_nominal_flow():
    # ISO 6358: 600 l/min at 6.9 bar is choked, C = q/p; from 6 to 5 bar (7.01 to 6.01 bar absolute) with b of the file
    valve = part("MPP-3-1-8")
    b = valve.value("critical_ratio") or 0.35
    conductance = 0.01 / (6.9e5 + 101325.0)  # [m^3/(s Pa)] of reference air
    up, down = 6e5 + 101325.0, 5e5 + 101325.0
    by_hand = conductance * up * (1.0 - ((down / up - b) / (1.0 - b)) ** 2) ** 0.5
    flow = valve.number("nominal_flow")
    assert flow.inferred and flow.value == pytest.approx(by_hand, rel=2e-2)  # temperature and the linear band near shut


def test_a_least_flow_leaves_those_that_pass_it():
    assert {one.id for one in list_parts("valves", min_flow="700 l/min")} == {"MPYE-5-1-4", "MPYE-5-1-8-HF"}
    assert {one.id for one in list_parts("sources", min_flow="13 l/min")} == {"compressor-mains"}
    light = list_parts("valves", max_mass="100 g")
    assert {one.id for one in light} == {"C100P-80", "MHE2-3-2"}
    with pytest.raises(InputError, match="min_flow compares valves"):
        list_parts("laws", min_flow="1 l/min")


def test_names_of_valves_are_those_that_the_air_of_a_simulation_takes():
    for one in list_parts("valves"):
        assert Air(valve=one.id)._valve() is not None


def test_the_name_of_a_tube_is_its_bore_in_circuits_rigs_and_simulations():
    for one in list_parts("tubes"):
        tube = build_element("lumped_tube", {"length": "1 m", "diameter": one.id})
        assert float(tube.diameter) == one.value("inner_diameter")
    assert float(Air(tube=("1 m", "pu-6x4"))._tube(Environment()).diameter) == pytest.approx(4e-3)
    with pytest.raises(InputError, match="must be a length"):
        build_element("lumped_tube", {"length": "1 m", "diameter": "PU-4x3"})


def test_a_name_is_found_in_any_case_and_a_wrong_one_is_refused():
    assert part("pu-4X2").value("inner_diameter") == pytest.approx(2e-3)
    assert part("mpye-5-1/8").id == "MPYE-5-1-8-LF"
    with pytest.raises(InputError, match="Unknown part 'PU-4x3'. Did you mean 'PU-4x2'"):
        part("PU-4x3")
    with pytest.raises(InputError, match="Unknown kind 'pumps'"):
        list_parts("pumps")


def test_a_file_of_ones_own_is_a_part(tmp_path):
    path = tmp_path / "valve.toml"
    path.write_text(
        'schema = 1\nid = "mine"\nkind = "valve"\nelement = "three_way_valve"\ntitle = "my valve"\nsources = []\n'
        'valve.Cv = { value = 0.3, unit = "1", inferred = true }\n'
        + "".join(
            f'valve.{name} = {{ value = 5, unit = "ms", inferred = true }}\n'
            for name in ("opening_dead_time", "opening_time", "closing_dead_time", "closing_time")
        )
    )
    mine = part(str(path))
    assert mine == part_of_specimen(mk.specimen(path)) and mine.number("Cv").value == 0.3
    assert 2e-3 < mine.value("nominal_flow") < 6e-3  # a Cv of 0.3 is about 300 l/min


def test_the_data_frame_has_one_row_per_number():
    frame = mk.parts("tubes")
    assert list(frame.columns) == list(COLUMNS) and len(frame) == len(rows_of(list_parts("tubes")))
    wide = frame.pivot(index="part", columns="number", values="value")
    assert wide.loc["PU-6x4", "inner_diameter"] == pytest.approx(4e-3)
    assert set(mk.parts().kind) == set(KINDS)
