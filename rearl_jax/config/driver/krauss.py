"""Declaration of Krauss' model."""

from rearl_jax.config.driver import declaration

MODEL = declaration.DriverModel(
    name="krauss",
    title="Krauss: the safe speed of SUMO's standard driver, in continuous time and without dawdling",
    source="Krauss, Microscopic Modeling of Traffic Flow (1998), DLR-FB 98-08",
    parameters=(
        declaration.desired_speed(),
        declaration.time_gap(1.0, "SUMO, tau of the standard vehicle type"),
        declaration.jam_gap(2.5, "SUMO, minGap of a passenger car"),
        declaration.max_accel(2.6, "SUMO, accel of a passenger car"),
        declaration.comfort_decel(4.5, "SUMO, decel of a passenger car"),
    ),
)
