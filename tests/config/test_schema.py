"""Keys, their documentation and the finishing of records."""

import math
from dataclasses import dataclass
from enum import Enum

import pytest


class Colour(Enum):
    red = "red"
    blue = "blue"


def test_key_refuses_what_cannot_be_documented_or_shared():
    from rearl_jax.config._key import key

    with pytest.raises(ValueError, match="one non-empty line"):
        key(1, " ")
    with pytest.raises(ValueError, match="one non-empty line"):
        key(1, "two\nlines")
    with pytest.raises(ValueError, match="mutable"):
        key([1], "a list")


def test_nested_defaults_are_those_of_the_field():
    """A record that is used twice shows the values of each place, not those of its class."""
    from rearl_jax.config._key import key
    from rearl_jax.config._schema import groups_of

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
    from rearl_jax.config._schema import nearest

    assert nearest(name, ["study", "scenes.stride", "scenes.seconds", "mape.definition"]) == close


def test_finished_turns_lists_into_tuples_and_checks_inner_records_first():
    from rearl_jax.config._key import key
    from rearl_jax.config._schema import finished

    @dataclass(unsafe_hash=True)
    class Inner:
        edges: tuple[float, ...] | None = key(None, "edges")

        def check(self):
            if self.edges is not None and len(self.edges) < 2:
                raise ValueError(f"edges must have at least two values, got {self.edges}")

    @dataclass(unsafe_hash=True)
    class Outer:
        inner: Inner = key(Inner, "inner")
        pair: tuple[int, str] = key((1, "a"), "pair")

        def check(self):
            if self.pair[0] > 5:
                raise ValueError("pair must be small")

    record = Outer()
    record.inner.edges = [1.0, 2.0]
    record.pair = [2, "b"]
    done = finished(record)
    assert done == Outer(Inner((1.0, 2.0)), (2, "b"))
    assert isinstance(hash(done), int)
    assert finished(Outer()) == Outer()

    record.inner.edges = [1.0]
    with pytest.raises(ValueError, match=r"^inner\.edges must have at least two values"):
        finished(record)
    with pytest.raises(ValueError, match="^pair must be small"):
        finished(Outer(pair=(6, "b")))
    record = Outer()
    record.pair = [1]
    with pytest.raises(ValueError, match=r"^pair must have 2 values \[int, str\], got 1"):
        finished(record)


def test_values_as_the_user_writes_them():
    from rearl_jax.config._schema import as_plain, as_written, type_name

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


def test_nan_and_a_text_in_the_place_of_a_list_are_refused():
    from rearl_jax.config import EvaluateTask
    from rearl_jax.config._schema import finished, from_plain

    for group, name, value, said in (
        ("core", "density", float("nan"), r"core\.density must be float, got nan"),
        ("reference", "weights", (1.0, float("nan")), r"reference\.weights must be .*, got nan"),
        ("reference", "weights", "/home", r"reference\.weights must be .*, got '/home'"),
    ):
        config = EvaluateTask()
        setattr(getattr(config, group), name, value)
        with pytest.raises(ValueError, match=said):
            finished(config)
    for plain, said in (
        ({"core": 3}, "core is no mapping"),
        ({"study": 3}, "study=3 is no str"),
        ({"core": {"density": "many"}}, r"core\.density=many is no float"),
        ({"core": {"n_lanes": True}}, r"core\.n_lanes=True is no int"),
        ({"method": ["base"]}, r"method=\['base'\] is none of base"),
        ({"reference": {"weights": 1.0}}, r"reference\.weights=1\.0 is no \["),
    ):
        with pytest.raises(ValueError, match=said):
            from_plain(EvaluateTask, plain)
