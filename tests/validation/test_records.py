import dataclasses

import numpy as np
import pytest

from rearl_jax.validation import records


def arrays(scene):
    return {"actions": scene.actions} | dataclasses.asdict(scene.start) | dataclasses.asdict(scene.tracks)


def test_a_stored_scene_is_the_same_bit_for_bit(recorded, jobs):
    scene = recorded[jobs["drivers10"][0]]
    again = records.from_bytes(records.to_bytes(scene))
    for part in ("start", "tracks"):
        for name, values in dataclasses.asdict(getattr(scene, part)).items():
            stored = getattr(getattr(again, part), name)
            assert stored.dtype == values.dtype, name
            np.testing.assert_array_equal(stored, values, err_msg=name)
    np.testing.assert_array_equal(again.actions, scene.actions)


def test_scenes_are_stacked_along_the_last_axis(recorded, jobs):
    scenes = [recorded[job] for job in jobs["multi10"]]
    assert not np.array_equal(scenes[0].tracks.x, scenes[1].tracks.x)
    batch = records.stack(scenes)
    for number, scene in enumerate(scenes):
        np.testing.assert_array_equal(batch.tracks.x[..., number], scene.tracks.x)
        np.testing.assert_array_equal(batch.start.speed[..., number], scene.start.speed)
        np.testing.assert_array_equal(batch.actions[..., number], scene.actions)


def test_no_single_wrong_byte_goes_unnoticed(recorded, jobs):
    scene = recorded[jobs["stress10"][0]]
    content, expected = records.to_bytes(scene), arrays(scene)
    refused = 0
    random = np.random.default_rng(0)
    for position in random.integers(0, len(content), 300):
        damaged = bytearray(content)
        damaged[position] ^= 1 << random.integers(8)
        try:
            found = arrays(records.from_bytes(bytes(damaged)))
        except Exception:
            refused += 1
        else:  # a byte that means nothing, such as the date of a member
            for name, values in expected.items():
                np.testing.assert_array_equal(found[name], values, err_msg=f"{name}, byte {position}")
    assert refused > 250


def test_wrong_numbers_name_the_array(recorded, jobs):
    content = records.to_bytes(recorded[jobs["stress10"][0]])
    x = recorded[jobs["stress10"][0]].tracks.x.tobytes()
    damaged = bytearray(content)
    damaged[content.index(x) + 1000] ^= 1
    with pytest.raises(ValueError, match=r"wrong checksum of tracks\.x\.npy"):
        records.from_bytes(bytes(damaged))
