"""Declaration of Gipps' model."""

from rearl_jax.config.driver import declaration as usual

MODEL = usual.DriverModel(
    name="gipps",
    title="Gipps: the fastest speed from which the driver can stop behind a braking leader",
    source="Gipps, Transp. Res. B 15 (1981) 105",
    parameters=(
        usual.desired_speed(),
        usual.time_gap(),
        usual.jam_gap(),
        usual.max_accel(1.7, "Gipps (1981): mean of N(1.7, 0.3)"),
        usual.comfort_decel(3.4, "Gipps (1981): twice the acceleration"),
    ),
)
