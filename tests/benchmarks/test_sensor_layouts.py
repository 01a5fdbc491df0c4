"""Writers of large files in the layouts of sensors."""

import pytest

from benchmarks.sensor_layouts import write_exid, write_i24, write_pneuma, write_tgsim


@pytest.mark.parametrize(
    ("write", "name"),
    [(write_exid, "07_tracks.csv"), (write_i24, "a.json"), (write_pneuma, "a.csv"), (write_tgsim, "a.csv")],
)
def test_a_writer_writes_as_much_as_it_is_told(write, name, tmp_path):
    write(tmp_path / name, 100_000)
    assert 100_000 <= (tmp_path / name).stat().st_size < 3_000_000
