"""Declaration of the Intelligent Driver Model as published."""

from rearl_jax.config.driver import declaration

MODEL = declaration.DriverModel(
    name="idm",
    title="Intelligent Driver Model as published, with bumper-to-bumper gaps",
    source="Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805",
    parameters=(
        declaration.desired_speed(),
        declaration.time_gap(),
        declaration.jam_gap(),
        declaration.max_accel(),
        declaration.comfort_decel(),
    ),
)
