"""The figure of a stream of rollouts."""

import pandas as pd
from matplotlib.figure import Figure

from rearl_jax.sweep.scale_figure import _memory


def test_the_last_part_is_not_cut_at_the_edge():
    table = pd.DataFrame({"session": [0, 0], "rollouts": [5, 10], "peak_mib": [9.0, 9.0], "resident_mib": [8.0, 8.5]})
    panel = Figure().subplots()
    _memory(panel, table, 10)
    assert panel.get_xlim() == (0, 10)
    assert [line.get_clip_on() for line in panel.lines] == [False, False]
