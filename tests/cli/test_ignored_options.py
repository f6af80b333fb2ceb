"""What was typed counts, or is refused: no option, name or value is ignored without a word."""

import pytest

from mckibben.cli._command import CONDITIONS
from mckibben.cli.app import main, table_of_commands


def refused(words, capsys):
    """The sentence with which the command line refuses some words."""
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["joint", "nylon", "--stiffness", "nothing=1"], "--stiffness is allowed only with --angle"),
        (["joint", "nylon", "--seed", "3"], "--seed is allowed only with --angle"),
        (["joint", "--angle", "0.1 rad", "--supply", "5 bar"], "--supply is allowed only without --angle"),
        (["fit", "map.csv", "--draws", "9"], "--draws is allowed only with --posterior"),
        (["run", "twitch", "--muscle", "fast-fibre", "--rig", "modern"], "--rig is of a test machine"),
        (["run", "twitch", "--muscle", "fast-fibre", "--step", "1 ms"], "--step is of a test machine"),
    ],
)
def test_an_option_is_refused_where_it_does_not_count(words, sentence, capsys):
    assert sentence in refused(words, capsys)


def test_conditions_name_options_that_their_commands_have():
    for words, rows in CONDITIONS.items():
        command = table_of_commands()
        for word in words.split():
            command = command.commands[word]
        options = {option for param in command.params for option in param.opts}
        assert {name for option, _, other in rows for name in (option, other)} <= options, words


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["joint", "--command", "flexor=0", "--command", "flexor=1"], "--command flexor must be given once"),
        (["fit", "x.csv", "--unit", "pressure=bar", "--unit", "pressure=kPa"], "--unit pressure must be given once"),
        (
            ["tension", "nylon", "--set", "law.passive_stiffness=3N/cm", "--set", "passive_stiffness=5N/cm",
             "--length", "13 cm", "--pressure", "3 bar"],
            "--set passive_stiffness must be given once",
        ),
    ],
)  # fmt: skip
def test_a_name_that_is_given_twice_is_refused(words, sentence, capsys):
    assert sentence in refused(words, capsys)


def test_parameters_of_a_biological_muscle_count_or_are_refused(capsys):
    words = ["tension", "fast-fibre", "--length", "14 cm", "--activation", "1", "--json"]
    assert "Unknown --set nothing" in refused([*words, "--set", "nothing=3"], capsys)
    assert "section_area must be" in refused([*words, "--set", "section_area=-1 cm^2"], capsys)
    tensions = []
    for change in ([], ["--set", "maximum_tension_intensity=1e5 N/m^2"]):
        with pytest.raises(SystemExit):
            main([*words, *change])
        tensions.append(capsys.readouterr().out)
    assert tensions[0] != tensions[1]


def test_columns_of_a_played_table_that_are_no_command_are_named(tmp_path, capsys):
    table = tmp_path / "played.csv"
    table.write_text("time [s],flexor [1],extensr [1]\n0,0,0\n0.01,0.2,0.3\n0.02,0.2,0.3\n", encoding="utf-8")
    with pytest.raises(SystemExit):
        main(["joint", "nylon", "--play", str(table)])
    assert "has columns that are no command, and are not used: extensr" in capsys.readouterr().err


def test_a_list_of_tasks_takes_no_models(capsys):
    assert "--earlier is allowed only without --list" in refused(["benchmark", "--list", "--earlier", "x.json"], capsys)
