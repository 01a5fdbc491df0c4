"""Declaration of highway-env's Intelligent Driver Model."""

from rearl_jax.config.driver import declaration

_SOURCE = "highway-env 1.12.1, IDMVehicle"

MODEL = declaration.DriverModel(
    name="highway_env_idm",
    title="Intelligent Driver Model of highway-env, with gaps from centre to centre of vehicles of 5 m",
    source="highway-env 1.12.1, IDMVehicle.acceleration",
    parameters=(
        declaration.desired_speed(None, "highway-env 1.12.1: null = each vehicle's initial speed"),
        declaration.time_gap(1.5, f"{_SOURCE}.TIME_WANTED"),
        declaration.jam_gap(5.0, f"{_SOURCE}.DISTANCE_WANTED less a length of 5 m"),
        declaration.max_accel(3.0, f"{_SOURCE}.COMFORT_ACC_MAX"),
        declaration.comfort_decel(5.0, f"{_SOURCE}.COMFORT_ACC_MIN"),
        declaration.DriverParameter(
            "accel_exponent",
            "-",
            "exponent delta of speed over desired speed",
            usual=None,
            low=0.5,
            high=20.0,
            source=f"{_SOURCE}.randomize_behavior: null = drawn from 3.5 to 4.5",
            spread=0.1,
            location=0.3,  # published values reach from 1 to 10
            median=4.0,
        ),
    ),
)
