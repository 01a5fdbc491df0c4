"""Keys, their documentation and the finishing of records."""

import functools
import math
from dataclasses import dataclass
from enum import Enum

import pytest

from rearl_jax.config import DiscoverTask, EvaluateTask, ReportTask
from rearl_jax.config._key import key
from rearl_jax.config._schema import as_plain, as_written, finished, from_plain, groups_of, nearest, type_name
from rearl_jax.problems import out_of_range
from tests.refusal import refused


class Colour(Enum):
    red = "red"
    blue = "blue"


def test_key_refuses_what_cannot_be_documented_or_shared():
    for default, text in ((1, " "), (1, "two\nlines"), ([1], "a list")):
        with pytest.raises(ValueError, match="key|default"):
            key(default, text)


def test_nested_defaults_are_those_of_the_field():
    """A record that is used twice shows the values of each place, not those of its class."""

    @dataclass(unsafe_hash=True)
    class Range:
        low: float = key(0.0, "lower edge")

    @dataclass(unsafe_hash=True)
    class Both:
        speed: Range = key(lambda: Range(low=5.0), "speeds")
        gap: Range = key(Range, "gaps")

    groups = {group.name: group for group in groups_of(Both())}
    assert {name: group.keys[0].default for name, group in groups.items()} == {"speed": "5.0", "gap": "0.0"}
    assert groups["speed"].help == "speeds"
    assert groups["gap"].keys[0].name == "gap.low"


@pytest.mark.parametrize(
    ("name", "close"),
    [
        ("scenes.strid", "scenes.stride"),
        ("stride", "scenes.stride"),
        ("Scenes.Stride", "scenes.stride"),
        ("studdy", "study"),
        ("mape.defintion", "mape.definition"),
    ],
)
def test_nearest(name, close):
    assert nearest(name, ["study", "scenes.stride", "scenes.seconds", "mape.definition"]) == close


def test_finished_turns_lists_into_tuples_and_checks_inner_records_first():
    @dataclass(unsafe_hash=True)
    class Inner:
        edges: tuple[float, ...] | None = key(None, "edges")

        def check(self):
            if self.edges is not None and len(self.edges) < 2:
                raise out_of_range("edges", "must have at least two values", self.edges)

    @dataclass(unsafe_hash=True)
    class Outer:
        inner: Inner = key(Inner, "inner")
        pair: tuple[int, str] = key((1, "a"), "pair")

        def check(self):
            if self.pair[0] > 5:
                raise out_of_range("pair", "must be small", self.pair)

    record = Outer()
    record.inner.edges = [1.0, 2.0]
    record.pair = [2, "b"]
    done = finished(record)
    assert done == Outer(Inner((1.0, 2.0)), (2, "b"))
    assert isinstance(hash(done), int)
    assert finished(Outer()) == Outer()

    record.inner.edges = [1.0]
    with refused("out-of-range", key="inner.edges"):
        finished(record)
    with refused("out-of-range", key="pair"):
        finished(Outer(pair=(6, "b")))
    record = Outer()
    record.pair = [1]
    with refused("wrong-length", key="pair"):
        finished(record)


def test_values_as_the_user_writes_them():
    assert [as_written(value) for value in (None, True, (1, 2.5), Colour.red, "", "x")] == [
        "null",
        "true",
        "[1, 2.5]",
        "red",
        "''",
        "x",
    ]
    assert type_name(float | None) == "float or null"
    assert type_name(tuple[int, ...]) == "[int, ...]"
    assert type_name(tuple[int, float]) == "[int, float]"
    assert type_name(Colour) == "red|blue"
    assert as_plain({"a": (math.inf, Colour.blue)}) == {"a": ["inf", "blue"]}


@pytest.mark.parametrize(
    "key",
    [
        "hist.high", "realism.speed.high", "realism.ttc.weight", "realism.pseudocount", "realism.collision_weight",
        "core.density", "core.speed_limit", "driver.accel_exponent_sd", "reference.weights", "matcher.value_weight",
        "kl.weights", "bo.penalty", "scenes.stride", "data.ring", "data.stretch", "llm.temperature",
    ],
)  # fmt: skip
def test_an_infinite_number_is_refused_where_no_figure_could_follow_from_it(key):
    config = EvaluateTask()
    *groups, name = key.split(".")
    record = functools.reduce(getattr, groups, config)
    usual = getattr(record, name)
    setattr(record, name, (math.inf,) * len(usual) if isinstance(usual, tuple) else math.inf)
    if name == "stretch":
        record.stretch = (math.inf,) * 6
    with refused("out-of-range", key=key):
        finished(config)


def test_an_infinite_threshold_means_never():
    config = EvaluateTask()
    config.detection.threshold_h = math.inf
    assert finished(config).detection.threshold_h == math.inf


@pytest.mark.parametrize("task", [EvaluateTask, ReportTask])
def test_an_empty_folder_of_results_is_refused(task):
    config = task()
    config.results.root = ""
    with refused("out-of-range", key="results.root"):
        finished(config)


def test_a_negative_seed_is_refused():
    config = DiscoverTask()
    config.discover.seed = -1
    with refused("out-of-range", key="discover.seed"):
        finished(config)


def test_nan_and_a_text_in_the_place_of_a_list_are_refused():
    for group, name, value in (
        ("core", "density", float("nan")),
        ("reference", "weights", (1.0, float("nan"))),
        ("reference", "weights", "/home"),
    ):
        config = EvaluateTask()
        setattr(getattr(config, group), name, value)
        with refused("wrong-type", key=f"{group}.{name}"):
            finished(config)
    for plain, code, name, value in (
        ({"core": 3}, "wrong-type", "core", 3),
        ({"driver": 3}, "choice-unknown", "driver.model", 3),
        ({"study": 3}, "wrong-type", "study", 3),
        ({"core": {"density": "many"}}, "wrong-type", "core.density", "many"),
        ({"core": {"n_lanes": True}}, "wrong-type", "core.n_lanes", True),
        ({"method": ["base"]}, "choice-unknown", "method", ["base"]),
        ({"reference": {"weights": 1.0}}, "wrong-type", "reference.weights", 1.0),
    ):
        with refused(code, key=name, value=value):
            from_plain(EvaluateTask, plain)
