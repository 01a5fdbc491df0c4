"""Figures of the error: the floor is never above it, and shares of what could be removed are shares."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.response_time import Covariances, Responses
from rearl_jax.discovery.report.error_block import STATISTICS, error_block, explained_share, lowers_predicting_errors
from rearl_jax.discovery.report.errors import MEASURES, ModelErrors, model_errors
from rearl_jax.discovery.report.protocols import PROTOCOL_MEASURES, PROTOCOLS, ProtocolErrors
from rearl_jax.discovery.report.tables import error_table, read_errors
from rearl_jax.discovery.resampling import Resampling

N = 30


def made(size, floor, seed=0):
    """Errors of a model, of about a size and with a floor."""
    rng = np.random.default_rng(seed)

    def errors():
        return size * rng.uniform(0.5, 1.5, N)

    by_driver = {name: errors() for name in MEASURES}
    protocols = dict.fromkeys(
        PROTOCOLS, ProtocolErrors(np.arange(N), {name: by_driver[name] for name in PROTOCOL_MEASURES}, by_driver, 0)
    )
    nothing = np.zeros((N, 3))
    return ModelErrors(
        by_driver,
        floor * rng.uniform(0.5, 1.5, N),
        protocols | {"other_runs": None},
        Responses(Covariances(1.0, nothing[:, :1], nothing)),
    )


def test_errors_survive_their_table(tmp_path):
    few = {name: np.arange(1.0, 5.0) for name in PROTOCOL_MEASURES}
    errors = {name: made(size, 0.3, seed) for name, size, seed in (("before", 1.0, 1), ("after", 0.8, 2))}
    for one in errors.values():
        one.protocols["first_half"] = ProtocolErrors(np.array([0, 3, 5, 9]), few, few, N - 4)
    block = error_block(errors, Resampling(0.9, 50, 0))
    error_table(errors).to_parquet(tmp_path / "errors.parquet")
    again = error_block(read_errors(pd.read_parquet(tmp_path / "errors.parquet"), block), Resampling(0.9, 50, 0))
    assert again["response_time"] == {"before": None, "after": None}
    assert again["protocols"]["first_half"]["left_out"] == N - 4
    assert again == block | {"response_time": again["response_time"]}


@pytest.mark.parametrize(
    ("population", "first_half", "expected"), [(0.6, 0.9, True), (0.6, 1.1, False), (0.999, 0.999, False)]
)
def test_others_are_predicted_better_only_if_no_protocol_says_worse(population, first_half, expected):
    """Errors of drives that parameters were calibrated to say nothing about it."""
    before, scatter = np.linspace(2.0, 4.0, N), 0.1 * np.resize([1.0, -1.0], N)
    errors = {}
    for name, factors in (("before", (1.0, 1.0)), ("after", (population, first_half))):
        protocols = {
            protocol: ProtocolErrors(np.arange(N), dict.fromkeys(PROTOCOL_MEASURES, values), {}, 0)
            for protocol, factor in zip(("population", "first_half"), factors, strict=True)
            for values in [factor * before + scatter * (name == "after")]
        }
        protocols |= {"other_runs": None, "in_sample": protocols["population"]}
        protocols = {key: of and replace(of, population=of.by_driver) for key, of in protocols.items()}
        errors[name] = replace(made(1.0 if name == "before" else 0.1, 0.1), protocols=protocols)
    block = error_block(errors, Resampling(0.9, 500, 0))
    assert block["change"]["high"] < 0
    assert lowers_predicting_errors(block) is expected


@pytest.mark.parametrize("n_seeds", [2, pytest.param(5, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("floor", [0.1, 0.6, 1.0, 1.4, 5.0])
@pytest.mark.parametrize("after", [0.6, 0.99, 1.3])
def test_the_floor_is_at_most_the_error_and_shares_are_within_0_and_1(after, floor, n_seeds):
    for seed in range(n_seeds):
        block = error_block(
            {"before": made(1.0, 1.0, seed), "after": made(after, floor, seed + 9)}, Resampling(0.9, 200, seed)
        )
        for end in ("value", "low", "high"):
            assert block["floor"][end] <= block["after"][end] + 1e-12
            assert block["floor"][end] <= block["noise_alone"][end] + 1e-12
        share = block["explained_share"]
        assert share is None or 0.0 <= share <= 1.0
        if floor > 2 * after:
            assert share is None


def test_share_of_what_could_be_removed():
    resamples = np.ones(50)

    def share(before, after, noise):
        return explained_share(before * resamples, after * resamples, noise * resamples, 0.9)

    assert share(2.0, 1.0, 1.0) == 1.0
    assert share(2.0, 1.0, 0.0) == pytest.approx(0.75)
    assert share(2.0, 2.1, 0.0) == 0.0
    assert share(2.0, 2.0, 1.99) is None  # nothing to remove
    assert share(2.0, 1.0, 1.1) is None  # noise that is none


def test_statistics_of_drivers_before_and_after():
    before, after = made(1.0, 0.1), made(0.5, 0.1)
    found = error_block({"before": before, "after": after}, Resampling(0.9, 200, 0))["protocols"]
    assert found["other_runs"] is None
    values = before.by_driver["gap_rmse"]
    expected = {"mean": values.mean(), "median": np.median(values), "pooled": np.sqrt((values**2).mean())}
    for name in STATISTICS:
        row = found["first_half"]["gap_rmse"][name]
        assert row["before"]["value"] == row["population"]["value"] == pytest.approx(expected[name])
        assert row["change_share"]["value"] == pytest.approx(-0.5)
        assert row["change"]["low"] <= row["change"]["value"] <= row["change"]["high"] < 0


def test_the_final_model_is_compared_with_calibrated_idm():
    errors = {"before": made(1.0, 0.1), "after": made(0.5, 0.1), "idm": made(2.0, 0.1)}
    found = error_block(errors, Resampling(0.9, 200, 0))["protocols"]["first_half"]["gap_rmse"]["mean"]
    assert found["idm"]["value"] == pytest.approx(2.0 * found["before"]["value"])
    assert found["idm_share"]["value"] == pytest.approx(-0.75)
    assert found["idm_share"]["high"] < 0
    alone = error_block({name: errors[name] for name in ("before", "after")}, Resampling(0.9, 200, 0))
    assert "idm" not in alone["protocols"]["first_half"]["gap_rmse"]["mean"]


def test_the_table_has_every_driver_under_every_protocol():
    after = replace(made(0.5, 0.1), protocols=made(0.5, 0.1).protocols | {"first_half": None})
    table = error_table({"before": made(1.0, 0.1), "after": after})
    assert set(table["protocol"]) == set(PROTOCOLS) - {"other_runs"}
    assert (table.groupby(["model", "protocol"]).size() == N).all()
    assert "first_half" not in set(table.loc[table["model"] == "after", "protocol"])
    in_sample = table["protocol"] == "in_sample"
    assert table.loc[in_sample, "floor"].notna().all()
    assert table.loc[~in_sample, "floor"].isna().all()
    assert table[["gap_rmse", "population_gap_rmse"]].notna().all().all()


def test_drives_of_the_right_model_are_about_as_far_off_as_their_own_noise_makes_them(solver, calibrated, measured_of):
    state, noise = calibrated
    found = model_errors(solver, measured_of(), Fit(None, state, noise), 0)
    error = found.by_driver["gap_rmse"]
    # The middle one: some change lanes, of which this model knows nothing.
    assert 0.75 < np.median(found.floor / error) < 1.3
