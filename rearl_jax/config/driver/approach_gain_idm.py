"""Declaration of the Intelligent Driver Model with a separate approach-rate gain."""

from rearl_jax.config.driver import declaration

_ACC = "order of magnitude of calibrated adaptive cruise control"

MODEL = declaration.DriverModel(
    name="approach_gain_idm",
    title="Intelligent Driver Model with a separate gain for the approach rate",
    source=(
        "after Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805, and the relative-speed term of Milanes & "
        "Shladover, Transp. Res. C 48 (2014) 285"
    ),
    parameters=(
        declaration.desired_speed(),
        declaration.time_gap(),
        declaration.jam_gap(),
        declaration.max_accel(),
        declaration.DriverParameter(
            "gap_exponent", "-", "exponent p of desired over actual gap", 2.0, 0.2, 10.0, "2 as in IDM", spread=0.3
        ),
        declaration.approach_gain(0.5, _ACC),
        declaration.speed_gain(0.4, "Xiao, Wang & van Arem, Transp. Res. Rec. 2623 (2017) 1"),
    ),
)
