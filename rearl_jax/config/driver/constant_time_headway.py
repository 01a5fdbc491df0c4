"""Declaration of the constant time headway controller."""

from rearl_jax.config.driver import declaration

_ACC = "order of magnitude of calibrated adaptive cruise control"

MODEL = declaration.DriverModel(
    name="constant_time_headway",
    title="Adaptive cruise control: linear in gap error and approach rate, at a constant time headway",
    source="Milanes & Shladover, Transp. Res. C 48 (2014) 285, ACC model with gap and speed control",
    parameters=(
        declaration.desired_speed(),
        declaration.time_gap(1.5, "usual middle setting of adaptive cruise control, ISO 15622: 0.8 to 2.2 s"),
        declaration.jam_gap(),
        declaration.DriverParameter("gap_gain", "1/s^2", "acceleration per gap error", 0.1, 0.002, 3.0, _ACC, 0.5),
        declaration.approach_gain(0.5, _ACC),
        declaration.speed_gain(0.4, "Xiao, Wang & van Arem, Transp. Res. Rec. 2623 (2017) 1"),
    ),
)
