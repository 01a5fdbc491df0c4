"""Names of columns in copies of NGSIM's tables: other spellings, and units in brackets."""

import pandas as pd
import pytest

from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.formats.published_names import split_unit
from rearl_jax.data.readers import reader_of
from rearl_jax.data.recordings import iterate_recordings
from tests.data.formats.ngsim_files import published
from tests.refusal import refused


@pytest.fixture
def read(tmp_path):
    def read(rows: pd.DataFrame) -> pd.DataFrame:
        rows.to_csv(tmp_path / "us-101.csv", index=False)
        (recording,) = iterate_recordings(DataConfig(DataFormat.ngsim, str(tmp_path)))
        return recording.table

    return read


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("v_Vel (ft/s)", ("v_Vel", "ft/s")),
        ("Speed1[ km/h ]", ("Speed1", "km/h")),
        ("Lane_ID", ("Lane_ID", "")),
        ("(ft)", ("(ft)", "")),
    ],
)
def test_a_unit_stands_in_brackets_behind_the_name(name, parts):
    assert split_unit(name) == parts


def test_units_in_the_names_of_columns_are_converted(read, tmp_path):
    rows = published()
    expected = read(rows)
    units = {"Local_X": ("(m)", 0.3048), "Local_Y": ("[ft]", 1.0), "v_Vel": (" (km/h)", 1.09728)}
    units |= {"v_Acc": (" [m/s2]", 0.3048), "Global_Time": ("[s]", 1e-3), "Preceding": (" [-]", 1)}
    stated = {f"{name}{unit}": rows[name] * factor for name, (unit, factor) in units.items()}
    found = read(pd.concat([rows.drop(columns=list(units)), pd.DataFrame(stated)], axis=1))
    pd.testing.assert_frame_equal(found, expected)
    recognises = reader_of(DataFormat.ngsim).recognises
    assert recognises is not None
    assert recognises(tmp_path) == tmp_path


def test_an_unknown_unit_and_two_spellings_of_a_column_stop(read):
    rows = published()
    with refused("unit-unknown", column="v_Vel (furlong/h)"):
        read(rows.rename(columns={"v_Vel": "v_Vel (furlong/h)"}))
    with refused("column-twice", column="Local_Y (m)"):
        read(rows.assign(**{"Local_Y (m)": rows["Local_Y"] * 0.3048}))
