"""Declaration of Gipps' model."""

from rearl_jax.config.driver import declaration

MODEL = declaration.DriverModel(
    name="gipps",
    title="Gipps: the fastest speed from which the driver can stop behind a braking leader",
    source="Gipps, Transp. Res. B 15 (1981) 105",
    parameters=(
        declaration.desired_speed(),
        declaration.time_gap(),
        declaration.jam_gap(),
        declaration.max_accel(1.7, "Gipps (1981): mean of N(1.7, 0.3)"),
        declaration.comfort_decel(3.4, "Gipps (1981): twice the acceleration"),
    ),
)
