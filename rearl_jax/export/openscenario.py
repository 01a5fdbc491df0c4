"""Drivers as a catalogue of controllers in OpenSCENARIO XML: one controller per driver, its parameters as properties.

OpenSCENARIO has no car-following equation. A controller is the driver of a vehicle, and its properties are left to the
program that runs the scenario: here the parameters under the names of this package, in SI units.

Source: ASAM OpenSCENARIO XML 1.2, `Controller` and `Properties`. The file is written by scenariogeneration, and
satisfies the schema of the standard that comes with it.
"""

import tempfile
from datetime import UTC, datetime
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from rearl_jax.export.drawn import DriverColumns, draw
from rearl_jax.export.translations import Exported, Translation, untranslated_effects
from rearl_jax.models.population import Population

DRIVER = "driver_{}"
"""Name of each controller."""

_PROPERTY = "property {}"
_NO_EQUATION = "OpenSCENARIO has no car following: the program that runs the scenario must have this equation"
_OF_VEHICLE = "give the vehicle of this driver the same in the scenario"
_DATE = datetime(1970, 1, 1, tzinfo=UTC)  # fixed, so that the same drivers give the same file; the header needs a date


def check_openscenario() -> None:
    """Raise ModuleNotFoundError with the remedy if scenariogeneration is missing."""
    if find_spec("scenariogeneration") is None:
        raise ModuleNotFoundError(
            "scenariogeneration is not installed, which to=openscenario needs: install the extra with "
            'pip install "rearl-jax[openscenario]", or choose another target'
        )


def to_openscenario(population: Population, n_drivers: int, seed: int) -> Exported:
    """A catalogue of controllers, each a driver drawn from a population.

    The population is as of `models.population.population_of_model`.

    Raises:
        ModuleNotFoundError: scenariogeneration is not installed.
    """
    check_openscenario()
    drawn = draw(population, n_drivers, seed)
    return Exported(_catalogue(drawn), tuple(_translations(population, drawn)))


def _catalogue(drawn: DriverColumns) -> str:
    """Content of the catalogue file."""
    xosc = import_module("scenariogeneration.xosc")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ControllerCatalog.xosc"
        catalogue = xosc.CatalogFile()
        description = f"drivers following by {drawn.car_following}, SI units"
        catalogue.create_catalog(str(path), "ControllerCatalog", description, "rearl_jax", creation_date=_DATE)
        for number in range(len(drawn)):
            properties = xosc.Properties()
            for name, value in _properties(drawn, number).items():
                properties.add_property(name, value)
            catalogue.add_to_catalog(xosc.Controller(DRIVER.format(number), properties))
        catalogue.dump()
        return path.read_text(encoding="utf-8")


def _properties(drawn: DriverColumns, number: int) -> dict[str, str]:
    """Properties of the controller of one driver of those drawn."""
    numbers = {name: values[number] for name, values in drawn.values.items()} | {"length": drawn.length[number]}
    return {
        "car_following": drawn.car_following,
        **{name: f"{value:.6g}" for name, value in numbers.items()},
        "vehicle_class": "truck" if drawn.is_truck[number] else "car",
    }


def _translations(population: Population, drawn: DriverColumns) -> list[Translation]:
    """Counterpart in OpenSCENARIO of each part of the model."""
    parts = [Translation(f"car_following {drawn.car_following}", _PROPERTY.format("car_following"), _NO_EQUATION)]
    parts += [Translation(name, _PROPERTY.format(name)) for name in drawn.values]
    parts.append(Translation("length", _PROPERTY.format("length"), _OF_VEHICLE))
    parts.append(Translation("class of vehicles", _PROPERTY.format("vehicle_class"), _OF_VEHICLE))
    parts += untranslated_effects((effect.name for effect in population.effects), "OpenSCENARIO")
    if population.is_noisy:
        parts.append(Translation("noise_sd, noise_time", None, "a property holds one value, and no process in time"))
    return [
        *parts,
        Translation("lane changing", None, "belongs to the controller's program, as car following does"),
    ]
