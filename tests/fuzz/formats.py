"""Every format the package reads, with a sound recording and the columns that change units together."""

from collections.abc import Callable
from dataclasses import dataclass

from rearl_jax.config.data import DataFormat
from tests.fuzz import recorders, traffic
from tests.fuzz.traffic import Source


@dataclass(frozen=True)
class Format:
    """A reader under test.

    Attributes:
        reads: The value of data.format.
        make: The sound recording.
        kinds: Columns that a converter would put into a wrong unit together, by kind of quantity.
    """

    reads: DataFormat
    make: Callable[[], Source]
    kinds: dict[str, tuple[str, ...]]


def _kinds(lengths: str, speeds: str, **others: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Kinds of quantities, and all lengths, or lengths and everything with a time in it, in wrong units together."""
    return others | {"lengths": tuple(lengths.split()), "everything": (*lengths.split(), *speeds.split())}


_CANONICAL = _kinds(
    "position x y lateral length width",
    "speed acceleration",
    position=("position", "x"),
    ground=("x",),
    across=("y", "lateral"),
    **{name: (name,) for name in ("y", "lateral", "speed", "acceleration", "length", "width", "time")},
)
_PUBLISHED = _kinds(
    "Local_X Local_Y v_Length v_Width",
    "v_Vel v_Acc",
    position=("Local_Y",),
    lateral=("Local_X",),
    speed=("v_Vel",),
    acceleration=("v_Acc",),
    length=("v_Length",),
    width=("v_Width",),
)
_HIGHD = _kinds(
    "x y width height upperLaneMarkings lowerLaneMarkings",
    "xVelocity xAcceleration speedLimit",
    position=("x",),
    lateral=("y",),
    speed=("xVelocity",),
    acceleration=("xAcceleration",),
    length=("width",),
    width=("height",),
    frame_rate=("frameRate",),
    speed_limit=("speedLimit",),
    markings=("upperLaneMarkings", "lowerLaneMarkings"),
)
_US101 = _kinds(
    "x_m y_m",
    "speed_mps accel_mps2",
    position=("y_m",),
    lateral=("x_m",),
    speed=("speed_mps",),
    acceleration=("accel_mps2",),
)
_I80 = _kinds(
    "y_f_m y_l_m leader_length_m",
    "v_f_mps v_l_mps a_f_mps2 a_l_mps2",
    position=("y_f_m", "y_l_m"),
    speed=("v_f_mps", "v_l_mps"),
    acceleration=("a_f_mps2", "a_l_mps2"),
    length=("leader_length_m",),
    time=("t_s",),
)
_I80_LATERAL = _kinds(
    "y_f_m y_l_m x_f_m length_f_m leader_length_m width_f_m leader_width_m",
    "v_f_mps v_l_mps a_f_mps2 a_l_mps2",
    position=("y_f_m", "y_l_m"),
    lateral=("x_f_m",),
    speed=("v_f_mps", "v_l_mps"),
    acceleration=("a_f_mps2", "a_l_mps2"),
    length=("length_f_m", "leader_length_m"),
    width=("width_f_m", "leader_width_m"),
)
_OPENACC = {"speed": ("speed_mps",), "gap": ("gap_to_follower_m",), "time": ("t_s",)}
_TGSIM = _kinds(
    "xloc-kf yloc-kf length-smoothed width-smoothed",
    "speed-kf acceleration-kf",
    position=("xloc-kf", "yloc-kf"),
    speed=("speed-kf",),
    acceleration=("acceleration-kf",),
    length=("length-smoothed",),
    width=("width-smoothed",),
    time=("time",),
)
_EXID = _kinds(
    "xCenter yCenter length width",
    "lonVelocity lonAcceleration speedLimit",
    position=("xCenter", "yCenter"),
    speed=("lonVelocity",),
    acceleration=("lonAcceleration",),
    length=("length",),
    width=("width",),
    frame_rate=("frameRate",),
    speed_limit=("speedLimit",),
)
_OPENACC_RAW = {
    "speed": tuple(f"Speed{k}" for k in (1, 2, 3, 4)),
    "gap": tuple(f"IVS{k}" for k in (1, 2, 3)),
    "time": ("Time",),
}
_VISSIM = _kinds("POS LENGTH", "SPEED", position=("POS",), speed=("SPEED",), length=("LENGTH",), time=("SIMSEC",))
_SUMO = {
    "position": ("vehicle_pos",),
    "ground": ("vehicle_x", "vehicle_y"),
    "speed": ("vehicle_speed",),
    "time": ("timestep_time",),
}

FORMATS = {
    "highd": Format(DataFormat.highd, traffic.highd, _HIGHD),
    "ngsim_csv": Format(DataFormat.ngsim, lambda: traffic.published("trajectories.csv"), _PUBLISHED),
    "ngsim_txt": Format(DataFormat.ngsim, lambda: traffic.published("us101.txt"), _PUBLISHED),
    "us101": Format(DataFormat.us101, traffic.us101, _US101),
    "i80": Format(DataFormat.i80, traffic.i80, _I80),
    "i80_lateral": Format(DataFormat.i80_lateral, traffic.i80_lateral, _I80_LATERAL),
    "openacc": Format(DataFormat.openacc, traffic.openacc, _OPENACC),
    "openacc_raw": Format(DataFormat.openacc, recorders.openacc_raw, _OPENACC_RAW),
    "tgsim": Format(DataFormat.tgsim, recorders.tgsim, _TGSIM),
    "exid": Format(DataFormat.exid, recorders.exid, _EXID),
    "vissim": Format(DataFormat.vissim, recorders.vissim, _VISSIM),
    "sumo": Format(DataFormat.sumo, recorders.sumo, _SUMO),
    "table_csv": Format(DataFormat.table, lambda: traffic.canonical("a.csv", described=True), _CANONICAL),
    "table_parquet": Format(DataFormat.table, lambda: traffic.canonical("a.parquet", described=True), _CANONICAL),
    "table_foreign": Format(DataFormat.table, lambda: traffic.canonical("a.csv", described=False), _CANONICAL),
}
"""By name."""
