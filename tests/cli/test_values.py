"""Odd words on the command line: those of texts and of mappings are read as they are meant, or the remedy works."""

import pytest

from rearl_jax.cli.composition import compose_task
from rearl_jax.cli.values import readable
from rearl_jax.config._schema import as_written, keys_of
from rearl_jax.config.quoting import quoted
from rearl_jax.tasks import TASKS
from tests.refusal import refused

PREPARE = next(task for task in TASKS if task.words == "prepare")

WORDS = (
    "car (M1)",
    "Car, small: #1",
    "PKW größer",
    "a [b] {c}",
    "it's",
    'the "big" one',
    "a\\b",
    "ends in \\",
    '\\"',
    "${data.root}",
    "\\${x}",
    "true",
    "null",
    "1e5",
    "007",
    "12",
    "=",
    "&;!~<>|",
    " blanks around ",
    "",
    "line\nbreak",
    "\U0001f697",
    "m\udcfcll",
)


def composed(*words, config_dir=None):
    return compose_task(PREPARE, ["data=us101", *words], config_dir)


@pytest.mark.parametrize("word", WORDS)
def test_quoted_words_of_a_mapping_are_read_back(word):
    given = f"{{{quoted(word)}: {quoted(word)}, plain: {quoted('x: {y}, ' + word)}}}"
    assert composed(f"data.classes={given}").data.classes == {word: word, "plain": f"x: {{y}}, {word}"}


@pytest.mark.parametrize("word", [word for word in WORDS if word])
def test_quoted_words_are_read_back_as_texts(word):
    config = composed(f"data.root={quoted(word)}", f"study={quoted(word)}")
    assert (config.data.root, config.study) == (word, word)


def test_a_mapping_as_written_is_read_back():
    classes = dict.fromkeys(WORDS, "car") | {3: "truck", "x": None}
    assert composed(f"data.classes={as_written(classes)}").data.classes == classes


def test_mappings_without_odd_words_are_those_of_hydra():
    config = composed("data.classes={1: car, Pick up: 'truck', b: null}", "data.columns={speed: \"v: m/s, 'a'\"}")
    assert config.data.classes == {1: "car", "Pick up": "truck", "b": None}
    assert config.data.columns == {"speed": "v: m/s, 'a'"}


def test_words_of_a_mapping_are_added_to_those_of_a_configuration_file(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "mine.yaml").write_text('format: table\nroot: x\nclasses: {"a: b": car}\n')
    config = composed("data=mine", 'data.classes={"c, d": truck}', config_dir=str(tmp_path))
    assert config.data.classes == {"a: b": "car", "c, d": "truck"}


@pytest.mark.parametrize("value", ["true", "False", "1e5", "1.0", "1.50", "007", "1_000", "+5", "NaN", "-0", "12"])
def test_texts_that_look_like_numbers_are_kept_as_typed(value):
    config = composed(f"data.recordings={value}", f"study={value}")
    assert (config.data.recordings, config.study) == (value, value)


@pytest.mark.parametrize("value", ["größe", "[2024] data", "(c", "a#b", "it's", "~/x", "a=b", "m\udcfcll", "a;b"])
def test_texts_that_hydra_cannot_read_are_kept_as_typed(value):
    assert composed(f"data.root={value}").data.root == value


def test_lists_of_texts_are_kept_as_typed():
    task = next(task for task in TASKS if task.words == "study real")
    keys = keys_of(task.defaults())
    assert readable(["real.sets=[i80, true,1e5]", "study"], keys) == ["real.sets=[i80, 'true','1e5']", "study"]


@pytest.mark.parametrize(
    ("word", "key"),
    [
        ("data.classes={car (M1): car}", "data.classes"),
        ("data.root=(a,b)", "data.root"),
        ("data.max_jump=(1", "data.max_jump"),
    ],
)
def test_a_value_that_cannot_be_read_is_named(word, key):
    with refused("value-unreadable", key=key) as caught:
        composed(word)
    remedy = caught.value.problem.remedy
    if key == "data.classes":
        composed("data.classes" + remedy.split("'data.classes")[1].rstrip("'"))
    elif key == "data.root":
        assert composed(remedy.split("'")[1]).data.root == "(a,b)"
    else:
        assert "quote" not in remedy


def test_a_key_in_the_address_of_a_server_is_not_repeated():
    task = next(task for task in TASKS if task.words == "evaluate")
    for address in ("http://h/v1?key=s3cret", '"http://h/v1?key=s3cret"', "http://h/v1?key=s3cret,x"):
        with refused("key-in-address", key="decision.server") as caught:
            compose_task(task, ["decision=llm", f"decision.server={address}"], None)
        assert "s3cret" not in str(caught.value)
