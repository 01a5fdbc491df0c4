"""Episodes among recorded vehicles, on a small recording: who is seen, followed and touched, and what is refused."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from rearl_jax import FunctionalHighway, MetaAction, cut_scenes, make_env
from rearl_jax.environments import highway, rendering
from rearl_jax.environments.highway import HighwayOptions
from rearl_jax.environments.starts import with_scenes
from rearl_jax.problems import InvalidInputError

RATE, SECONDS = 5, 6
#: Vehicle: lane, place and time at which it passes [m, s], speed [m/s], first second. 3 drives 100 m ahead of 1 in the
#: second scene, 4 only 30 m ahead of 2; both enter after 1 and 2, so they are not picked.
VEHICLES = {1: (0, 220, 6, 20, 0), 2: (1, 170, 6, 20, 0), 3: (0, 320, 6, 12, 5), 4: (1, 200, 6, 12, 5)}
SCENE = 1
OPTIONS = {"duration": SECONDS - 1, "n_rows": 4}


@pytest.fixture(scope="module")
def table():
    parts = []
    for track, (lane, place, time, speed, first) in VEHICLES.items():
        t = np.arange(first * RATE, 13 * RATE) / RATE
        rows = {"track_id": track, "time": t, "position": place + speed * (t - time), "lane": lane}
        parts.append(pd.DataFrame(rows | {"speed": float(speed), "length": 5.0}))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def scenes(table):
    keys = {"seconds": SECONDS, "slots": 2, "min_vehicles": 2}
    return cut_scenes(table, scenes=keys, speed={"norm": "none"})


@pytest.fixture(scope="module")
def cached(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def measured(scenes, table, cached):
    return with_scenes(HighwayOptions(**OPTIONS), scenes, "measured", table)


def case_of(scenes, track):
    """Number of the case of the second scene in which a vehicle is controlled."""
    return SCENE * scenes.n_slots + scenes.track_id[SCENE, 0].tolist().index(track)


def driven(options, starts, cases, actions):
    """First observations, and the states after every second."""
    start = jax.jit(lambda keys: highway.begin(keys, options, starts.start(jnp.asarray(cases))))
    state = start(jax.random.split(jax.random.key(0), len(cases)))
    second = jax.jit(
        lambda state, action: highway.advance(state, action, options, highway.surroundings_now(state, starts.around))
    )
    first, states = np.asarray(highway.observe(state, options)), [state]
    for _ in range(OPTIONS["duration"]):
        states.append(second(states[-1], jnp.asarray(actions, jnp.int32)))
    return first, states


@pytest.fixture(scope="module")
def episodes(scenes, measured):
    """Vehicle 1 controlled and idle, then 2 faster: among recorded vehicles, and on a free road."""
    cases, actions = [case_of(scenes, 1), case_of(scenes, 2)], [MetaAction.IDLE, MetaAction.FASTER]
    free = with_scenes(HighwayOptions(**OPTIONS), scenes)
    return driven(*measured, cases, actions), driven(*free, cases, actions)


def test_a_recorded_vehicle_ahead_is_seen(episodes):
    (first, states), (alone, _) = episodes
    np.testing.assert_allclose(first[1, :, 0], [1, 100 / 200, 0, -8 / 80, 0], atol=1e-6)
    np.testing.assert_allclose(first[1, :, 1], [1, 30 / 200, 0, -8 / 80, 0], atol=1e-6)  # 4, ahead of 1 at 50 m
    assert first[2, 1, 1] == pytest.approx(50 / 200)
    np.testing.assert_array_equal(alone[1:, :, 0], 0)  # 2 is behind
    np.testing.assert_array_equal(alone[0], first[0])
    later = highway.observe(states[2], HighwayOptions(**OPTIONS, n_lanes=2))
    ego = states[2].traffic
    ahead = 150 + 2 * 12 - float(ego.x[0, 0])  # positions count from vehicle 2, the rearmost
    assert float(later[1, 1, 0]) == pytest.approx(ahead / 200, abs=1e-5)


def test_a_recorded_vehicle_ahead_is_followed(episodes):
    (_, among), (_, free) = episodes
    speed, alone = (float(states[1].traffic.speed[1, 1]) for states in (among, free))
    assert alone == pytest.approx(20, abs=0.01)
    assert speed < alone - 0.3


def test_the_controlled_vehicle_crashes_if_it_touches_a_recorded_one(episodes):
    (_, among), (_, free) = episodes
    crashed = np.array([state.traffic.crashed[0] for state in among])
    assert not crashed[:, 0].any()
    assert not crashed[0, 1]
    assert crashed[-1, 1]
    second = int(crashed[:, 1].argmax())
    ego, replayed = among[second].traffic, among[second].replayed
    gaps = np.abs(np.asarray(replayed.x[:, 1]) - float(ego.x[0, 1]))
    assert gaps.min() < 5 + 16  # within a second's way of it
    assert not np.array([state.traffic.crashed[0] for state in free]).any()


def test_pictures_show_recorded_vehicles(episodes, measured):
    (_, among), _ = episodes
    picture = rendering.pictures(among[0], measured[0])[1]
    assert (picture == np.array(rendering._REPLAYED, np.uint8)).all(axis=-1).any()


def test_drivers_want_the_highest_recorded_speed_as_on_a_free_road(table, cached):
    faster = 0.5 * (table["time"] - 6)  # by 0.5 m/s every second
    rising = table.assign(speed=table["speed"] + faster, position=table["position"] + faster * (table["time"] - 6) / 2)
    keys = {"seconds": SECONDS, "slots": 2, "min_vehicles": 2}
    scenes = cut_scenes(rising, scenes=keys, speed={"norm": "none"})
    among, alone = (
        with_scenes(HighwayOptions(**OPTIONS), scenes, *boundary)[1].state for boundary in (("measured", rising), ())
    )
    np.testing.assert_array_equal(among.desired_speed, alone.desired_speed)
    np.testing.assert_allclose(among.desired_speed[1:] - among.speed[1:], 0.5 * (SECONDS - 1), atol=0.11)


@pytest.mark.slow
def test_the_functional_environment_is_the_same_traffic(scenes, table, cached):
    env = FunctionalHighway(scenes, "measured", table, **OPTIONS)
    params = env.default_params.replace(max_steps_in_episode=50)
    assert int(params.duration) == SECONDS - 1  # more was not recorded
    keys, actions = jax.random.split(jax.random.key(1), 3), jnp.arange(1, 4, dtype=jnp.int32)
    first, state = jax.vmap(env.reset)(keys)
    assert (np.asarray(first)[:, 1:, 0].sum(axis=1) > 0).any()
    observation, *_ = jax.jit(jax.vmap(partial(env.step_env, params=params)))(keys, state, actions)
    last = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, -1), state)
    advance = jax.jit(partial(highway.advance, options=env.options))
    after = advance(last, actions, boundary_second=highway.surroundings_now(last, params.around))
    np.testing.assert_allclose(observation, np.moveaxis(highway.observe(after, env.options), -1, 0), atol=1e-6)


@pytest.mark.thorough  # programs of their own
def test_gymnasium_environments_drive_among_them(scenes, table, cached):
    env = make_env(scenes=scenes, boundary="leaders", data=table, **OPTIONS)
    envs = make_env(num_envs=3, scenes=scenes, boundary="leaders", data=table, **OPTIONS)
    single, batch = env.reset(seed=5)[0], envs.reset(seed=5)[0]
    for _ in range(OPTIONS["duration"]):
        np.testing.assert_array_equal(batch[0], single)
        single, _, terminated, truncated, _ = env.step(MetaAction.IDLE)
        batch = envs.step(np.full(3, MetaAction.IDLE))[0]
    assert truncated or terminated


def test_without_recorded_vehicles_nothing_is_read(scenes):
    _, starts = with_scenes(HighwayOptions(**OPTIONS), scenes, "free", {"format": "highd"})
    assert starts.around is None
    assert starts.start(jnp.asarray(0)).replayed is None


@pytest.mark.parametrize(
    ("changes", "code", "key"),
    [
        ({"scenes": None}, "scenes-missing", "boundary"),
        ({"boundary": "mesured"}, "choice-unknown", "boundary"),
        ({"options": {"duration": SECONDS}}, "out-of-range", "duration"),
        ({"data": {"rot": "/data"}}, "key-unknown", "rot"),
    ],
)
def test_what_does_not_fit_is_refused(scenes, table, cached, changes, code, key):
    given = {"options": OPTIONS, "scenes": scenes, "boundary": "measured", "data": table} | changes
    with pytest.raises(InvalidInputError) as caught:
        FunctionalHighway(given["scenes"], given["boundary"], given["data"], **given["options"])
    assert (caught.value.code, caught.value.problem.key) == (code, key)


def test_rescaled_speeds_and_other_recordings_are_refused(scenes, table, cached):
    faster = table.assign(speed=table["speed"] * (1 + 0.01 * table["track_id"]))
    rescaled = cut_scenes(faster, scenes={"seconds": SECONDS, "slots": 2, "min_vehicles": 2}, speed={"norm": "minmax"})
    with pytest.raises(InvalidInputError) as caught:
        make_env(scenes=rescaled, boundary="measured", data=table, **OPTIONS)
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", "speed.norm")
    moved = table.assign(position=table["position"] + 1)
    with pytest.raises(InvalidInputError) as caught:
        make_env(scenes=scenes, boundary="measured", data=moved, **OPTIONS)
    assert caught.value.code == "recording-missing"
