"""Declaration of the Intelligent Driver Model as published."""

from rearl_jax.config.driver import declaration as usual

MODEL = usual.DriverModel(
    name="idm",
    title="Intelligent Driver Model as published, with bumper-to-bumper gaps",
    source="Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805",
    parameters=(
        usual.desired_speed(),
        usual.time_gap(),
        usual.jam_gap(),
        usual.max_accel(),
        usual.comfort_decel(),
    ),
)
