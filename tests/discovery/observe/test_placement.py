"""Measured arrays that stay on the devices between evaluations."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from rearl_jax.core.batch import ScenarioMap
from rearl_jax.discovery.observe.fit_state import replaced
from rearl_jax.discovery.observe.observer import Pieces
from rearl_jax.discovery.observe.placement import Placements


def _own_pieces(state) -> Pieces:
    """The pieces of a state with arrays that nothing else holds."""
    return jax.tree.map(np.array, state.pieces)


@pytest.fixture
def program() -> ScenarioMap:
    return ScenarioMap(lambda a: a, chunk=4)


def test_states_side_by_side_have_the_sums_that_they_have_alone(solver, calibrated):
    state, _ = calibrated
    shifted = replaced(state, z=state.z + 0.1)
    longer = replaced(state, pieces=replace(state.pieces, known=np.zeros_like(state.pieces.y) + 0.01))
    together = [replaced(one) for one in (state, shifted, longer)]
    solver.sums(together)
    for number, one in enumerate((state, shifted, longer)):
        alone = replaced(one)
        solver.sums([alone])
        np.testing.assert_allclose(together[number].sums.gram, alone.sums.gram, rtol=1e-9)
    assert together[0].sums.square.sum() != together[1].sums.square.sum() != together[2].sums.square.sum()


def test_a_placed_array_holds_all_pieces_and_cannot_be_changed(calibrated, program):
    pieces = _own_pieces(calibrated[0])
    n = pieces.y.shape[-1]
    placed = Placements().pieces([pieces, pieces], program, 2 * n + 1)
    joined = np.concatenate(placed.y.chunks, axis=-1)
    np.testing.assert_array_equal(joined[:, :n], pieces.y)
    np.testing.assert_array_equal(joined[:, n : 2 * n], pieces.y)
    assert (joined[:, 2 * n :] == pieces.y[:, -1:]).all(), "padding is the last piece"
    with pytest.raises(ValueError, match="read-only"):
        pieces.y[0] = 0.0


def test_arrays_are_placed_once_and_leave_with_their_source(calibrated, program):
    pieces, placements = _own_pieces(calibrated[0]), Placements()
    n = pieces.y.shape[-1]
    first = placements.pieces([pieces], program, n)
    again = placements.pieces([replace(pieces, weight=pieces.weight * 0.5)], program, n)
    assert again.y is first.y
    assert again.weight is not first.weight
    before = placements.nbytes
    assert before > 0
    del pieces
    assert placements.nbytes == 0


def test_the_arrays_used_last_stay_within_the_limit(calibrated, program):
    some, other = _own_pieces(calibrated[0]), _own_pieces(calibrated[0])
    n = some.y.shape[-1]
    size = Placements()
    size.pieces([some], program, n)
    placements = Placements(most_bytes=size.nbytes)
    placements.pieces([some], program, n)
    kept = placements.pieces([other], program, n)
    assert placements.nbytes <= size.nbytes
    assert placements.pieces([other], program, n).y is kept.y
