"""Time gaps of cars: measured without a model, of calibrated drivers, and the differences between settings."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import DiscoverConfig
from rearl_jax.config.driver import record_of
from rearl_jax.study.real import facts
from rearl_jax.study.real.facts import FACT_COLUMNS, differences_of, facts_of, near_equilibrium
from rearl_jax.study.real.known import KNOWN_TIME_GAPS, KnownTimeGap
from tests.study.real.made import SPEED, platoon

OVER = DiscoverConfig(draws=200)


@pytest.fixture
def calibrated(monkeypatch):
    """Instead of a calibration: every driver keeps the time gap that it was made with."""

    def known(data, model, speed, *, lane_changes):
        assert speed == pytest.approx(SPEED)
        asked.append((model.model, lane_changes))
        return data.driver_mean(data.gap) / SPEED

    asked = []
    monkeypatch.setattr(facts, "_calibrated", known)
    return asked


def found(cars, known=None, models=None):
    """Facts of cars, each {setting: time gaps of its tracks}."""
    models = {"S": record_of("idm")(), "L": record_of("gipps")()} if models is None else models
    table = facts_of(platoon(cars), "setting", "model", models, known or {}, lane_changes=True)
    return table.set_index(["car", "setting"])


def test_a_time_gap_is_that_of_steady_driving_by_car_and_setting(calibrated):
    table = found({"A": {"S": [1.4, 1.6, 1.5], "L": [2.5]}, "B": {"S": [1.1]}})
    assert sorted(table.index) == [("A", "L"), ("A", "S"), ("B", "S")]
    short = table.loc[("A", "S")]
    assert short["model_free"] == pytest.approx(1.5)
    assert short["calibrated"] == pytest.approx(1.5)
    assert short["difference"] == pytest.approx(0.0)
    assert (short["tracks"], short["runs"]) == (3, 3)
    assert short["model_free_deviation"] == pytest.approx(0.1 / np.sqrt(3))
    assert table["known"].isna().all()
    assert sorted(calibrated) == [("gipps", True), ("idm", True)]


def test_moments_away_from_equilibrium_do_not_count():
    data = platoon({"A": {"S": [1.5]}})
    assert near_equilibrium(data).mean() > 0.9
    data.smooth_speed[: len(data.y) // 2] = 4.0  # slow, and slower than the leader
    late = near_equilibrium(data)
    assert not late[: len(data.y) // 2].any()
    assert late[len(data.y) // 2 + 2 :].any()


def test_what_is_known_is_compared(calibrated):
    known = {"A": {"S": KnownTimeGap(1.6, 0.05), "L": KnownTimeGap(2.0, 0.05)}}
    table = found({"A": {"S": [1.5], "L": [2.5]}, "B": {"S": [1.1]}}, known)
    assert table["within"].isna().to_dict() == {("A", "L"): False, ("A", "S"): False, ("B", "S"): True}
    assert not table.loc[("A", "L"), "within"]
    assert table.loc[("A", "S"), "within"]
    assert table.loc[("A", "S"), "known"] == pytest.approx(1.6)


def test_a_setting_without_a_model_is_measured_only(calibrated):
    table = found({"A": {"S": [1.5], "M": [2.0]}}, models={"S": record_of("idm")()})
    assert table.loc[("A", "M"), "model_free"] == pytest.approx(2.0)
    assert table.loc[("A", "M"), "calibrated"] is pd.NA
    assert calibrated == [("idm", True)]


def of_set(rows):
    table = pd.DataFrame(rows).assign(set="openacc", title="ZalaZone")
    return table.reindex(columns=["set", "title", *FACT_COLUMNS])


def test_differences_are_those_of_the_same_cars():
    rows = [
        {"car": car, "setting": setting, "calibrated": gap, "model_free": gap + 0.1}
        for car, gaps in {"A": (1.5, 2.5), "B": (1.2, 2.0), "C": (1.3, None)}.items()
        for setting, gap in zip("SL", gaps, strict=True)
        if gap is not None
    ]
    table = differences_of(of_set(rows), OVER).set_index("method")
    row = table.loc["calibrated"]
    assert (row["first"], row["second"], row["cars"], row["longer"]) == ("L", "S", 2, 2)
    assert row["value"] == pytest.approx(0.9)
    assert row["low"] == pytest.approx(0.8)
    assert row["high"] == pytest.approx(1.0)
    assert table.loc["model_free", "first_mean"] == pytest.approx(2.35)


def test_a_pair_of_settings_needs_two_cars():
    rows = [{"car": "A", "setting": setting, "calibrated": 1.0, "model_free": 1.0} for setting in "SL"]
    assert differences_of(of_set(rows), OVER).empty
    assert differences_of(of_set([]), OVER).empty


def test_every_known_time_gap_is_shorter_in_the_short_setting():
    assert len(KNOWN_TIME_GAPS) == 10
    assert all(gaps["S"].value < gaps["L"].value for gaps in KNOWN_TIME_GAPS.values())
