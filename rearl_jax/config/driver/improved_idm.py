"""Declaration of the improved Intelligent Driver Model."""

from rearl_jax.config.driver import declaration, idm

MODEL = declaration.DriverModel(
    name="improved_idm",
    title="improved Intelligent Driver Model, whose equilibrium gap is s0 + v T up to the desired speed",
    source="Treiber & Kesting, Traffic Flow Dynamics (2013), section 11.3.7",
    parameters=idm.MODEL.parameters,
)
