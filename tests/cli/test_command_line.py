"""The command line of the task `drive far`: values, mistakes, own files, help."""

import logging

import pytest

from rearl_jax.problems import InvalidInputError
from rearl_jax.results import Study
from tests.refusal import refused


def test_defaults_then_files_then_command_line(cli):
    assert cli.main(["drive", "far", "road=wide", "road.exits=[1,2.5]", "side=left", "limit=30"]) == 0
    (config,) = cli.ran
    assert (config.road.lanes, config.road.length) == (6, 900.0)
    assert config.road.exits == (1.0, 2.5)
    assert config.road.span == (0.0, 1.0)
    assert config.side is cli.Side.left
    assert config.limit == 30.0
    assert isinstance(hash(config), int)
    assert cli.started == [False]


def test_no_litter(cli):
    assert cli.main(["drive", "far"]) == 0
    assert cli.ran[0].road.lanes == 2
    assert list(cli.work.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "code", "key", "nearest"),
    [
        ("drive far road.lane=3", "key-unknown", "road.lane", "road.lanes"),
        ("drive far lanes=3", "key-unknown", "lanes", "road.lanes"),
        ("drive far rod.lengt=3", "key-unknown", "rod.lengt", "road.length"),
        ("drive far road={lane:3}", "key-unknown", "road.lane", "road.lanes"),
        ("drive far +road.lanes=3", "key-added", "+road.lanes=3", ""),
        ("drive far ~road.lanes=3", "key-added", "~road.lanes=3", ""),
        ("drive far road.lanes=many", "wrong-type", "road.lanes", ""),
        ("drive far road.lanes=2.5", "wrong-type", "road.lanes", ""),
        ("drive far road.exits=[1,x]", "wrong-type", "road.exits", ""),
        ("drive far road.exits=7", "wrong-type", "road.exits", ""),
        ("drive far road.span=[1,2,3]", "wrong-length", "road.span", ""),
        ("drive far road.lanes=0", "out-of-range", "road.lanes", ""),
        ("drive far side=middle", "wrong-type", "side", ""),
        ("drive far study=null", "wrong-type", "study", ""),
        ("drive far road=wid", "choice-unknown", "road", "wide"),
        ("drive far road.lanes=(c", "value-unreadable", "road.lanes", ""),
        ("drive far study=(c,d", "value-unreadable", "study", ""),
        ("drive far road.exits=[1,(c]", "value-unreadable", "road.exits", ""),
        ("drive far study", "value-missing", "study", ""),
        ("drive far roda", "value-missing", "roda", "road"),
        ("drive far roda=wide", "key-unknown", "roda", "road"),
        ("drive far road=", "choice-unknown", "road", ""),
        ("drive far results=3", "wrong-type", "results", ""),
        ("drive far road.lanes=1,3", "several-values", "road.lanes", ""),
        ("drive far --multirn", "option-unknown", None, ""),
        ("drive far --config-dir nowhere", "folder-missing", None, ""),
        ("drive fat", "task-unknown", "drive fat", "rearl drive far"),
        ("drive", "task-unknown", "drive", "rearl drive far"),
        ("dive study=x", "task-unknown", "dive", "rearl drive far"),
        ("study=x", "task-missing", None, ""),
        ("drive far -m side=left,right --config", "options-conflict", "--config", ""),
        ("drive far --sweep sides --config", "options-conflict", "--config", ""),
        ("drive far -m road.lanes=interval(1,3)", "configuration-unreadable", None, ""),
        ("drive far -m road.lanes=1,3 sid=left,right", "key-unknown", "sid", "side"),
        ("drive far --sweep sidez", "choice-unknown", "--sweep", "sides"),
        ("drive far --sweep other", "sweep-of-another-task", "--sweep other", ""),
    ],
)
def test_mistakes_end_with_one_sentence(cli, capsys, words, code, key, nearest):
    with refused(code, key=key) as caught:
        cli.main([*words.split(), "--traceback"])
    assert not nearest or f"nearest: {nearest}" in str(caught.value)
    assert cli.main(words.split()) == 2
    assert capsys.readouterr().err == f"rearl: {caught.value}\n"
    assert "\n" not in str(caught.value)
    assert cli.ran == []
    assert list(cli.work.iterdir()) == []


def test_the_remedy_for_several_values_works(cli):
    for word, remedy in (
        ("road.lanes=1,3", "add -m for one job per value"),
        ("road.exits=1,3", "add -m for one job per value, or write road.exits=[1,3] for a list"),
        ("study=a,b", "add -m for one job per value, or quote a text twice: 'study=\"a,b\"'"),
    ):
        with refused("several-values", key=word.partition("=")[0]) as caught:
            cli.main(["drive", "far", word, "--traceback"])
        assert caught.value.problem.remedy == remedy
    assert cli.main(["drive", "far", "road.exits=[1,3]", 'study="a,b"']) == 0
    assert (cli.ran[0].road.exits, cli.ran[0].study) == ((1.0, 3.0), "a,b")


@pytest.mark.parametrize(
    ("fail", "said"),
    [(lambda: open("missing.csv"), "missing.csv"), (lambda: Study("results", "../up", None, "drive far"), "'../up'")],
)
def test_errors_of_the_file_system_and_of_the_package_are_for_the_user(cli, capsys, fail, said):
    cli.task.fail = fail
    assert cli.main(["drive", "far", "road.lanes=9"]) == 2
    assert said in capsys.readouterr().err


def test_error_of_a_library_keeps_its_traceback(cli):
    cli.task.fail = lambda: int("x")
    with pytest.raises(ValueError, match="literal"):
        cli.main(["drive", "far", "road.lanes=9"])


def test_traceback_on_request_of_the_environment(cli, monkeypatch):
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    with pytest.raises(InvalidInputError):
        cli.main(["drive", "far", "road.lanes=0"])


def test_interrupt(cli, capsys):
    def fail():
        raise KeyboardInterrupt

    cli.task.fail = fail
    assert cli.main(["drive", "far", "road.lanes=9"]) == 130
    assert "interrupted" in capsys.readouterr().err


def test_own_configuration_folder_and_an_unknown_key_in_a_file_of_it(cli, tmp_path):
    file = tmp_path / "mine" / "road" / "bridge.yaml"
    file.parent.mkdir(parents=True)
    command = ["drive", "far", "--config-dir", str(tmp_path / "mine"), "road=bridge", "--traceback"]
    file.write_text("lanes: 3\n")
    assert cli.main(command) == 0
    assert cli.ran[0].road.lanes == 3
    file.write_text("lengths: 3\n")
    with refused("key-unknown", key="road.lengths", file="road/bridge.yaml"):
        cli.main(command)


def test_print_configuration(cli, capsys):
    assert cli.main(["drive", "far", "road.lanes=5", "--config"]) == 0
    assert "  lanes: 5\n" in capsys.readouterr().out
    assert cli.ran == []


def test_a_key_given_twice_is_told_and_the_last_one_counts(cli, capsys):
    assert cli.main(["drive", "far", "limit=1", "side=left", "limit=2", "limit=3", "side=left"]) == 0
    assert [config.limit for config in cli.ran] == [3]
    assert capsys.readouterr().err.splitlines()[0].endswith(": limit=3")
    assert cli.main(["drive", "far", "limit=1", "side=left", "side=left"]) == 0
    assert "limit" not in capsys.readouterr().err


def test_a_key_that_another_implies_is_told(cli, caplog):
    logging.getLogger("rearl_jax").setLevel(logging.NOTSET)  # as a new process has it
    assert cli.main(["drive", "far", "road.length=5"]) == 0
    assert [record.args for record in caplog.records if record.name.endswith("composition")] == [("limit=50",)]


def test_keys_of_a_group_imply_others_unless_they_are_given(cli):
    assert cli.main(["drive", "far", "road.length=5"]) == 0
    assert cli.main(["drive", "far", "road.length=5", "limit=30"]) == 0
    assert cli.main(["drive", "far", "side=left"]) == 0
    assert [config.limit for config in cli.ran] == [50, 30, None]


def test_help_lists_every_key_with_type_default_and_meaning(cli, capsys):
    assert cli.main(["drive", "far", "--help"]) == 0
    text = capsys.readouterr().out
    for part in (
        "Drives along a road.",
        "road.lanes=4  (int)",
        "number of lanes",
        "limit=null  (float or null)",
        "side=right  (left|right)",
        "road.exits=[100.0, 200.0]  ([float, ...])",
        "road=narrow  one lane each way",
        "rearl drive far road.lanes=2",
    ):
        assert part in text


def test_help_lists_tasks(cli, capsys):
    assert cli.main([]) == 0
    without = capsys.readouterr().out
    assert cli.main(["--help"]) == 0
    assert capsys.readouterr().out == without
    assert "drive far  drive along" in without
    codes = without[without.index("exit codes:") :].split()
    assert {"0", "1", "2", "129", "130", "141", "143"} <= set(codes)
