"""Evidence in convoys without a missing effect, whose positions have the errors of satellite receivers."""

import pytest

from rearl_jax.config import DataConfig, DiscoverConfig, DiscoverTask
from rearl_jax.config.data import DataFormat
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.discovery.observe.base import base_of
from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.drivers import prior_of
from rearl_jax.discovery.observe.parts import measured_drivers
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.read.kernels import UNSMOOTHED
from rearl_jax.discovery.search.null import null_of
from rearl_jax.discovery.search.screen import evidences, scores
from rearl_jax.discovery.thresholds import THRESHOLDS
from tests.foreign.convoys import make
from tests.foreign.convoys.__main__ import write

OTHERS = tuple(Term(name) for name in ("rear_pressure", "several_leaders"))
"""Effects of other vehicles, whose positions help to predict what errors of measured gaps hide."""


@pytest.mark.slow
def test_errors_of_receivers_are_no_effects_of_other_vehicles(tmp_path):
    write(make("control", 6), tmp_path)
    recordings = list(iterate_recordings(DataConfig(format=DataFormat.table, root=str(tmp_path))))
    _, data = measured_drivers(recordings, DiscoverConfig(max_drivers=40))
    assert data.fused_errors is not None
    assert data.kernel is UNSMOOTHED  # fusing positions with speeds smooths them, their recording did not
    (driver,) = (each for each in DiscoverTask().compared if each.model == "approach_gain_idm")
    solver = solver_of(data, prior_of(driver))
    base = base_of(solver, data, lane_changes=False).fit
    (seen,) = scores(solver, [base.state])
    evidence = evidences(base.state, seen, solver.layout)
    z_scores = null_of(solver, base.state, base.noise, 8, 0).z_scores(evidence)
    # The pedals lag by a tenth of a second, which looks like a response to the acceleration of the leader.
    assert z_scores[Term("leader_acceleration")] > THRESHOLDS.candidate_z_score
    assert max(z_scores[term] for term in OTHERS) < THRESHOLDS.candidate_z_score, {t: z_scores[t] for t in OTHERS}
