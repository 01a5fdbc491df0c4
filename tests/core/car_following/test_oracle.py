"""Every car-following model against its formula in plain Python, its slopes against those derived by hand."""

import dataclasses
import functools
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.driver import DEFAULT, MODELS
from rearl_jax.core.car_following import CAR_FOLLOWING, CarFollowing
from rearl_jax.core.car_following.model import SpacingStimulus, linearise
from tests.core.car_following.oracle import DESIRED_GAPS, ORACLES

NAMES = sorted(ORACLES)

RANGES = {
    "desired_speed": (8.0, 45.0),
    "time_gap": (0.3, 3.0),
    "jam_gap": (0.6, 6.0),
    "max_accel": (0.3, 4.0),
    "comfort_decel": (0.5, 8.0),
    "accel_exponent": (1.0, 8.0),
    "gap_exponent": (0.5, 6.0),
    "gap_gain": (0.01, 1.0),
    "approach_gain": (0.02, 2.0),
    "speed_gain": (0.05, 2.0),
}
"""Ranges that the parameters are drawn from, wide enough for stable and unstable platoons."""

GAPS = (-6.0, -5.0, -0.3, 0.0, 1e-9, 0.3, 0.5, 0.51, 2.0, 9.0, 40.0, 300.0)
SPEEDS = (-3.0, -1e-6, 0.0, 1e-9, 0.4, 5.0, 14.0, 27.0, 50.0)
APPROACH_RATES = (-25.0, -6.0, -0.2, 0.0, 0.2, 6.0, 14.0, 27.0, 40.0)
"""States with everything that can go wrong: inside each other, at rest, too fast, leaders that reverse. highway-env's
vehicles can drive backwards for a moment.
"""

N_DRAWN = 1500


def drawn(name, n, seed=0):
    """Parameters of `n` drivers, `{parameter: [n]}`."""
    rng = np.random.default_rng([seed, NAMES.index(name)])
    return {p.name: np.exp(rng.uniform(*np.log(RANGES[p.name]), n)) for p in MODELS[name].parameters}


def driver_of(name, values):
    return CAR_FOLLOWING[name](**{key: jnp.asarray(value) for key, value in values.items()})


def one_by_one(values):
    """The drivers as the formulas take them."""
    n = len(values["time_gap"])
    return [SimpleNamespace(**{key: float(value[i]) for key, value in values.items()}) for i in range(n)]


@functools.cache
def situations():
    """Gap, speed and approach rate: each of the listed with each, and drawn ones."""
    listed = np.stack(np.meshgrid(GAPS, SPEEDS, APPROACH_RATES), -1).reshape(-1, 3).T
    rng = np.random.default_rng(1)
    random = np.stack([rng.uniform(*ends, N_DRAWN) for ends in ((-2.0, 120.0), (0.0, 45.0), (-12.0, 15.0))])
    return np.concatenate([listed, random], axis=1)


@functools.cache
def answers(name):
    """A model's acceleration and its derivatives in every situation, each with a driver of its own; NumPy arrays."""
    gap, speed, rate = (jnp.asarray(row) for row in situations())
    values = drawn(name, len(gap))

    def each(driver, gap, speed, rate):
        return {
            "free": driver.free_acceleration(speed),
            "acceleration": driver.acceleration(gap, speed, rate),
            "interaction": driver.interaction(gap, speed, rate),
            "equilibrium_gap": driver.equilibrium_gap(speed),
            "desired_gap": driver.desired_gap(speed, rate),
            "comfortable_deceleration": driver.comfortable_deceleration(),
        }

    @jax.jit
    def derive(*point):
        said, back = jax.vjp(each, *point)
        # Of a sum, which is finite only if every part is; weights, for otherwise acceleration and interaction cancel.
        return said, back({key: jnp.full_like(value, 1 + place) for place, (key, value) in enumerate(said.items())})

    said, slopes = derive(driver_of(name, values), gap, speed, rate)
    return values, jax.tree.map(np.asarray, said), jax.tree.map(np.asarray, slopes)


@functools.cache
def equilibria(name):
    """Drivers behind a leader of constant speed, `(values, speeds, linearisation, acceleration)`."""
    values = drawn(name, N_DRAWN, seed=2)
    # Up to 95 % of the desired speed: beyond, the equilibrium gap has no bound.
    speed = np.random.default_rng(3).uniform(0.01, 0.95, N_DRAWN) * values["desired_speed"]
    speed[:20] = 1e-9  # at rest, but for the slopes of powers

    @jax.jit
    def solve(driver, speed):
        gap = driver.equilibrium_gap(speed)
        slopes = linearise(driver, speed)
        said = driver.acceleration(gap, speed, jnp.zeros_like(speed))
        return gap, slopes, slopes.stability_margin(), said

    return values, speed, *jax.tree.map(np.asarray, solve(driver_of(name, values), jnp.asarray(speed)))


def test_every_model_has_its_oracle_and_its_declaration():
    assert set(ORACLES) <= set(CAR_FOLLOWING) == set(MODELS)
    assert len(ORACLES) >= 7  # of the library
    for name, model in CAR_FOLLOWING.items():
        assert model.declaration is MODELS[name]


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_are_those_of_the_formulas(name):
    values, said, _ = answers(name)
    oracle, people, (gap, speed, rate) = ORACLES[name], one_by_one(values), situations()
    free = np.array([oracle.free(v, p) for v, p in zip(speed, people, strict=True)])
    whole = np.array([oracle.acceleration(*state, p) for *state, p in zip(gap, speed, rate, people, strict=True)])
    np.testing.assert_allclose(said["free"], free, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(said["acceleration"], whole, rtol=1e-11, atol=1e-11)
    # What is subtracted may be a hundred times as large as the rest.
    scale = np.maximum(abs(free), abs(whole)) + 1
    assert (abs(said["interaction"] - (free - whole)) <= 1e-11 * scale).all()
    # The situations are various enough: who brakes hard, who barely, who accelerates.
    assert (whole < -9).mean() > 0.1
    assert (whole > 0.1).mean() > 0.1
    assert (abs(free - whole) < 0.05 * abs(free)).any()


@pytest.mark.parametrize("name", NAMES)
def test_equilibrium_gaps_are_those_of_the_formulas(name):
    values, speed, gap, _, _, said = equilibria(name)
    expected = [ORACLES[name].equilibrium_gap(v, p) for v, p in zip(speed, one_by_one(values), strict=True)]
    np.testing.assert_allclose(gap, expected, rtol=1e-11)
    np.testing.assert_allclose(said, 0, atol=1e-10)


@pytest.mark.parametrize("name", NAMES)
def test_desired_gaps(name):
    """s* of the two forms of IDM, also for leaders who drive away; of all others the gap at equilibrium."""
    values, said, _ = answers(name)
    _, speed, rate = situations()
    if name not in DESIRED_GAPS:
        np.testing.assert_array_equal(said["desired_gap"], said["equilibrium_gap"])
        return
    expected = [DESIRED_GAPS[name](v, dv, p) for v, dv, p in zip(speed, rate, one_by_one(values), strict=True)]
    np.testing.assert_allclose(said["desired_gap"], expected, rtol=1e-12, atol=1e-12)
    below = np.array(expected) < values["jam_gap"] - 1e-9
    assert below.any() == (name == "highway_env_idm")  # which alone wants less than the gap at standstill


@pytest.mark.parametrize("name", NAMES)
def test_comfortable_deceleration_is_the_parameter_where_there_is_one(name):
    values, said, _ = answers(name)
    np.testing.assert_array_equal(said["comfortable_deceleration"], values.get("comfort_decel", 2.0))


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_finite_everywhere(name):
    _, said, (driver, gap, speed, rate) = answers(name)
    for what, values in said.items():
        assert np.isfinite(values).all(), what
    by_parameter = {field.name: getattr(driver, field.name) for field in dataclasses.fields(driver)}
    for part, slope in (by_parameter | {"gap": gap, "speed": speed, "approach_rate": rate}).items():
        bad = ~np.isfinite(slope)
        assert not bad.any(), (part, situations()[:, bad][:, :3])
        assert abs(slope).max() > 0, part


@pytest.mark.parametrize("name", NAMES)
def test_linearisation_is_the_one_derived_by_hand(name):
    values, speed, _, slopes, margin, _ = equilibria(name)
    expected = [ORACLES[name].slopes(v, p) for v, p in zip(speed, one_by_one(values), strict=True)]
    for part, column in zip(slopes, np.array(expected).T, strict=True):
        np.testing.assert_allclose(part, column, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(margin, [one.margin for one in expected], rtol=1e-9, atol=1e-9)
    # Drivers keep away from a leader, do not run away by themselves, and do not gain by closing in.
    assert (slopes.gap > 0).all()
    assert (slopes.speed < 0).all()
    assert (slopes.approach_rate <= 0).all()
    # No parameters make Gipps' drivers unstable, none make Krauss' stable.
    low, high = {"gipps": (1.0, 1.0), "krauss": (0.0, 0.0)}.get(name, (0.05, 0.95))
    assert low <= (margin > 0).mean() <= high


def test_slow_idm_traffic_is_stable_where_the_acceleration_exceeds_jam_gap_over_squared_time_gap():
    """a >= s0 / T^2, Treiber & Kesting (2013), section 15.4."""
    values = drawn("idm", 400)
    margin = jax.jit(lambda *point: linearise(*point).stability_margin())(driver_of("idm", values), jnp.full(400, 1e-6))
    ratio = values["max_accel"] * values["time_gap"] ** 2 / values["jam_gap"]
    clear = abs(ratio - 1) > 1e-3
    np.testing.assert_array_equal(np.asarray(margin > 0)[clear], (ratio > 1)[clear])
    assert 0.1 < (ratio > 1).mean() < 0.9


@pytest.mark.parametrize("name", NAMES)
def test_amplification_is_that_of_the_linear_platoon(name):
    """It exceeds 1 just below the frequency whose square is the negative margin, and nowhere in stable traffic."""
    values, speed, _, slopes, margin, _ = equilibria(name)
    expected = [ORACLES[name].slopes(v, p) for v, p in zip(speed, one_by_one(values), strict=True)]
    for frequency in (0.05, 0.4, 2.0):
        gains = [one.gain(frequency) for one in expected]
        np.testing.assert_allclose(slopes.amplification(jnp.asarray(frequency)), gains, rtol=1e-9)
        assert (np.array(gains)[margin > 0] < 1).all()
    edge = np.sqrt(np.maximum(-margin, 1e-6))
    unstable = margin < -1e-3
    for factor, sign in ((0.9, 1), (1.0, 0), (1.1, -1)):
        excess = np.asarray(slopes.amplification(jnp.asarray(factor * edge)))[unstable] - 1
        assert (excess * sign > 0).all() if sign else (abs(excess) < 1e-9).all()


@pytest.mark.parametrize("name", NAMES)
def test_drivers_who_see_spacings_are_the_same_drivers(name):
    """A spacing is a gap and a length, a speed ratio holds the desired speed; highway-env's length is always 5 m."""
    values, said, _ = answers(name)
    gap, speed, rate = situations()
    length = 5.0 if name == DEFAULT else 7.5
    seen = speed > 0.1  # a vehicle at rest does not show its desired speed
    driver = driver_of(name, {key: value[seen] for key, value in values.items()})
    ratio = speed / values["desired_speed"]
    columns = (gap + length, np.full_like(gap, length), speed, ratio, rate)
    spacing = SpacingStimulus(*(jnp.asarray(column[seen]) for column in columns))
    whole, behind = said["acceleration"][seen], said["interaction"][seen]
    far = spacing.spacing > 0.5  # highway-env's own rules have another least distance
    for value, expected in ((driver.spacing_acceleration, whole), (driver.spacing_interaction, behind)):
        np.testing.assert_allclose(np.asarray(value(spacing))[far], expected[far], rtol=1e-9, atol=1e-9)
    wanted = driver.desired_spacing(spacing.length, spacing.speed, spacing.approach_rate)
    np.testing.assert_allclose(wanted, said["desired_gap"][seen] + length, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_parameters_go_by_the_order_of_the_declaration(name):
    values = drawn(name, 3)
    driver, declared = driver_of(name, values), MODELS[name]
    assert tuple(field.name for field in dataclasses.fields(driver)) == declared.names
    assert declared.names[:3] == ("desired_speed", "time_gap", "jam_gap")
    np.testing.assert_array_equal(driver.rows(), [values[key] for key in declared.names])
    again = CAR_FOLLOWING[name].of_rows(jnp.stack(driver.rows()))
    np.testing.assert_array_equal(again.rows(), driver.rows())
    changed = driver.with_setpoints(jnp.full(3, 20.0), jnp.full(3, 2.0), jnp.full(3, 4.0))
    np.testing.assert_array_equal(changed.rows()[:3], [[20.0] * 3, [2.0] * 3, [4.0] * 3])
    np.testing.assert_array_equal(changed.rows()[3:], driver.rows()[3:])


@pytest.mark.parametrize("name", NAMES)
def test_declared_values_are_within_their_bounds(name):
    model = MODELS[name]
    for parameter in model.parameters:
        assert 0 < parameter.low < parameter.high
        assert parameter.spread > 0
        for value in (parameter.usual, parameter.truck, parameter.prior_median):
            assert value is None or parameter.low <= value <= parameter.high
        assert parameter.low <= RANGES[parameter.name][0]
        assert RANGES[parameter.name][1] <= parameter.high
        assert parameter.meaning
        assert parameter.source


@pytest.mark.parametrize("fields", [(), ("comfort_decel", "max_accel"), ("max_accel",), ("max_accel", "decel")])
def test_fields_that_are_not_those_of_the_declaration_are_refused(fields):
    annotations = {"declaration": object} | dict.fromkeys(fields, jax.Array)
    with pytest.raises(TypeError, match="has the fields .* but its declaration says"):
        type("Wrong", (CarFollowing,), {"declaration": MODELS["idm"], "__annotations__": annotations})


@pytest.mark.parametrize("name", NAMES)
def test_usual_drivers_follow_each_other_steadily_or_nearly_so(name):
    """The usual parameters are those of measured traffic: waves grow slowly if at all at 15 m/s."""
    usual = SimpleNamespace(**{p.name: p.prior_median for p in MODELS[name].parameters})
    slopes = ORACLES[name].slopes(15.0, usual)
    assert max(slopes.gain(frequency) for frequency in np.linspace(0.05, 2.0, 60)) < 1.05
