"""Declaration of the full velocity difference model."""

from rearl_jax.config.driver import declaration as usual

MODEL = usual.DriverModel(
    name="fvdm",
    title="Full velocity difference model: relaxation towards a gap-dependent speed, plus a term in the approach rate",
    source=(
        "Jiang, Wu & Zhu, Phys. Rev. E 64 (2001) 017101; optimal velocity a hyperbolic tangent as in Bando et al., "
        "Phys. Rev. E 51 (1995) 1035, with its inflection at standstill"
    ),
    parameters=(
        usual.desired_speed(),
        usual.time_gap(),
        usual.jam_gap(),
        usual.speed_gain(0.41, "Jiang, Wu & Zhu (2001): sensitivity kappa"),
        usual.approach_gain(0.5, "Jiang, Wu & Zhu (2001): lambda"),
    ),
)
