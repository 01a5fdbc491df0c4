"""Declaration of the full velocity difference model."""

from rearl_jax.config.driver import declaration

MODEL = declaration.DriverModel(
    name="fvdm",
    title="Full velocity difference model: relaxation towards a gap-dependent speed, plus a term in the approach rate",
    source=(
        "Jiang, Wu & Zhu, Phys. Rev. E 64 (2001) 017101; optimal velocity a hyperbolic tangent as in Bando et al., "
        "Phys. Rev. E 51 (1995) 1035, with its inflection at standstill"
    ),
    parameters=(
        declaration.desired_speed(),
        declaration.time_gap(),
        declaration.jam_gap(),
        declaration.speed_gain(0.41, "Jiang, Wu & Zhu (2001): sensitivity kappa"),
        declaration.approach_gain(0.5, "Jiang, Wu & Zhu (2001): lambda"),
    ),
)
