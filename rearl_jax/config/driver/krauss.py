"""Declaration of Krauss' model."""

from rearl_jax.config.driver import declaration as usual

MODEL = usual.DriverModel(
    name="krauss",
    title="Krauss: the safe speed of SUMO's standard driver, in continuous time and without dawdling",
    source="Krauss, Microscopic Modeling of Traffic Flow (1998), DLR-FB 98-08",
    parameters=(
        usual.desired_speed(),
        usual.time_gap(1.0, "SUMO, tau of the standard vehicle type"),
        usual.jam_gap(2.5, "SUMO, minGap of a passenger car"),
        usual.max_accel(2.6, "SUMO, accel of a passenger car"),
        usual.comfort_decel(4.5, "SUMO, decel of a passenger car"),
    ),
)
