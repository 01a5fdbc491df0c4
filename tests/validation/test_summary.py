import pandas as pd
import pytest

from rearl_jax.config.validation import ValidationConfig
from rearl_jax.validation import summary
from rearl_jax.validation.causes import Cause

QUIET = {
    "size": 10,
    "vehicles": 10,
    "agrees": True,
    "lane_changes": 4,
    "aborts": 1,
    "crashes": 2,
    "lane_changes_alike": 4,
    "lane_changes_either": 4,
    "flips": 0,
    "flips_before_contact": 0,
    "crash_flags_equal": True,
    "max_position": 1e-12,
    "max_speed": 1e-13,
    "max_heading": 1e-14,
    "max_position_before_contact": 1e-12,
    "max_speed_before_contact": 1e-13,
    "max_heading_before_contact": 1e-14,
    "cause": None,
}
EASY = ValidationConfig(least_lane_changes=4, least_aborts=1, least_crashes=2)


def scenes(*changes):
    """Two scenes in both precisions, and what is changed of some: (index, precision, changes)."""
    rows = {
        (index, precision): QUIET
        | {"set": "road10", "scenario": f"s{index}", "index": index, "precision": precision}
        | ({"set": "road2", "size": 2} if index else {})
        for index in (0, 1)
        for precision in summary.PRECISIONS
    }
    for index, precision, changed in changes:
        base = rows.get((index, precision), rows[index, "float64"] | {"precision": precision})
        rows[index, precision] = base | changed
    return pd.DataFrame(list(rows.values())).astype({"cause": "str"})


def test_figures_of_scenes_that_agree():
    figures = summary.summarise(scenes(), "highway-env 1")
    assert (figures["scenes"], figures["lane_changes"], figures["aborts"], figures["crashes"]) == (2, 8, 2, 4)
    assert figures["agree_share_f64"] == figures["agree_share_f32"] == 1.0
    assert figures["n2_scenes"] == figures["n10_scenes"] == 1
    assert "n30_scenes" not in figures
    assert figures["unexplained"] == 0
    assert set(figures["exceptions_f64"].values()) == {0}
    assert (figures["control_scenes"], figures["control_agree_share"], figures["control_max_dx"]) == (0, None, None)
    assert summary.shortfalls(figures, EASY) == []


def test_one_scene_that_differs_shows_in_its_size_and_in_all():
    wrong = {"agrees": False, "cause": Cause.unexplained.value, "max_position": 0.5, "flips": 3}
    wrong |= {"lane_changes_alike": 2, "lane_changes_either": 6, "crash_flags_equal": False}
    figures = summary.summarise(scenes((1, "float64", wrong)), "highway-env 1")
    assert (figures["agree_share_f64"], figures["n2_agree_share_f64"], figures["n10_agree_share_f64"]) == (0.5, 0, 1)
    assert figures["max_dx_f64"] == figures["n2_max_dx_f64"] == 0.5
    assert figures["max_dx_before_contact_f64"] == 1e-12
    assert figures["lane_change_agreement_f64"] == 6 / 10
    assert figures["crash_agreement_f64"] == 0.5
    assert figures["flips_f64"] == 3
    assert figures["agree_share_f32"] == 1.0
    assert figures["exceptions_f64"][Cause.unexplained.value] == figures["unexplained"] == 1


def test_without_lane_changes_their_agreement_is_no_figure():
    none = {"lane_changes": 0, "lane_changes_alike": 0, "lane_changes_either": 0}
    figures = summary.summarise(scenes((0, "float64", none)), "highway-env 1")
    assert figures["n10_lane_change_agreement_f64"] is None
    assert figures["lane_change_agreement_f64"] == 1.0


def test_the_control_counts_for_itself_only():
    own = {"agrees": False, "cause": Cause.standstill.value, "max_position": 7.0}
    figures = summary.summarise(scenes((0, summary.CONTROL, own)), "highway-env 1")
    assert (figures["control_scenes"], figures["control_agree_share"], figures["control_max_dx"]) == (1, 0.0, 7.0)
    assert figures["control_core_agree_share"] == 1.0
    assert figures["scenes"] == 2
    assert figures["max_dx_f64"] == 1e-12
    assert sum(figures["exceptions_f64"].values()) == 0


def test_groups_are_sets_sizes_and_all():
    groups = summary.groups(scenes())
    assert list(groups["group"]) == 2 * ["road10", "road2", "N = 2", "N = 10", "all"]
    assert list(groups[groups["group"] == "all"]["scenes"]) == [2, 2]


@pytest.mark.parametrize(
    ("changed", "config", "code", "value"),
    [
        ((), {"least_lane_changes": 9}, "events-too-few", 8),
        ((), {"least_aborts": 3}, "events-too-few", 2),
        ((), {"least_crashes": 5}, "events-too-few", 4),
        (("float64", Cause.push), {}, "float64-differs", "50.00%"),
        (("float32", Cause.push), {"least_agree_share": 0.0}, "float32-differs", "50.00%"),
        (("float64", Cause.unexplained), {"least_agree_share": 0.0}, "unexplained", 1),
    ],
)
def test_each_demand_that_is_not_met_is_a_problem(changed, config, code, value):
    changes = [(1, changed[0], {"agrees": False, "cause": changed[1].value})] if changed else []
    figures = summary.summarise(scenes(*changes), "highway-env 1")
    options = ValidationConfig(**({"least_lane_changes": 8, "least_aborts": 2, "least_crashes": 4} | config))
    (problem,) = summary.shortfalls(figures, options)
    assert (problem.code, problem.value) == (code, value)


def test_a_share_of_the_scenes_must_show_a_share_of_the_events():
    figures = summary.summarise(scenes(), "highway-env 1")
    options = {"least_lane_changes": 80, "least_aborts": 20, "least_crashes": 40}
    assert len(summary.shortfalls(figures, ValidationConfig(**options))) == 3
    assert summary.shortfalls(figures, ValidationConfig(share=0.1, **options)) == []
