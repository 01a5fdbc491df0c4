"""Vehicle types of a SUMO file as records: attributes, with SUMO's defaults where the file states none.

Sources: SUMO 1.28, "Definition of Vehicles, Vehicle Types, and Routes" and "Vehicle Type Parameter Defaults".
"""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from scipy.stats import truncnorm

from rearl_jax.models.record import CAR, TRUCK
from rearl_jax.problems import InvalidInputError, MissingInputError, Problem

DEFAULT_MODEL = "Krauss"
"""SUMO's car-following model of types that name none."""


@dataclass(frozen=True)
class VehicleClass:
    """SUMO's defaults for vehicles of a class, in SUMO's units, and the class of this package."""

    kind: str
    length: float
    accel: float
    decel: float
    maxSpeed: float  # noqa: N815 - the attribute's name
    speedDev: float  # noqa: N815
    minGap: float = 2.5  # noqa: N815
    tau: float = 1.0


CLASSES = {
    "passenger": VehicleClass(CAR, 5.0, 2.6, 4.5, 200 / 3.6, 0.1),
    "private": VehicleClass(CAR, 5.0, 2.6, 4.5, 200 / 3.6, 0.1),
    "taxi": VehicleClass(CAR, 5.0, 2.6, 4.5, 200 / 3.6, 0.05),
    "delivery": VehicleClass(CAR, 6.5, 2.6, 4.5, 200 / 3.6, 0.05),
    "truck": VehicleClass(TRUCK, 7.1, 1.3, 4.0, 130 / 3.6, 0.05),
    "trailer": VehicleClass(TRUCK, 16.5, 1.1, 4.0, 130 / 3.6, 0.05),
    "bus": VehicleClass(TRUCK, 12.0, 1.2, 4.0, 100 / 3.6, 0.0),
    "coach": VehicleClass(TRUCK, 14.0, 2.0, 4.0, 100 / 3.6, 0.05),
}
"""Classes of vehicles that are read. Source: SUMO 1.28, vehicle type parameter defaults."""

_DISTRIBUTION = re.compile(r"normc?\(([^,()]+),([^,()]+)(?:,([^,()]+)(?:,([^,()]+))?)?\)")
"""`norm(mean, deviation)`, `normc(mean, deviation, low, high)`; `high` may be left out."""


@dataclass(frozen=True)
class VehicleType:
    """One vehicle type.

    Attributes:
        name: Id of the type.
        distribution: Id of its distribution; empty if there is none.
        weight: Probability in the distribution as stated, not normalised.
        attributes: Attributes that the file states.
        file: The file, for messages.
    """

    name: str
    distribution: str
    weight: float
    attributes: Mapping[str, str]
    file: str

    def refuse(self, code: str, fault: str, remedy: str, attribute: str) -> InvalidInputError:
        """The error about an attribute of the type."""
        value = self.attributes.get(attribute)
        return InvalidInputError(
            Problem(code, fault, remedy, self.file, f"vType {self.name}, {attribute}", value=value)
        )

    @property
    def model(self) -> str:
        """SUMO's name of its car-following model."""
        return self.attributes.get("carFollowModel", DEFAULT_MODEL)

    @property
    def vehicle_class(self) -> VehicleClass:
        """Class of the vehicles of this type.

        Raises:
            InvalidInputError: The vehicles are not cars, trucks or buses.
        """
        name = self.attributes.get("vClass", "passenger")
        if name not in CLASSES:
            remedy = f"leave the type out with sumo.types, or give it one of {', '.join(CLASSES)}"
            raise self.refuse("vehicle-class-unknown", "is no class of motorway vehicles", remedy, "vClass")
        return CLASSES[name]

    def number(self, attribute: str, default: float | None = None) -> tuple[float, float]:
        """Mean of an attribute and its standard deviation, 0 for a plain number; the default where it is not stated.

        Raises:
            InvalidInputError: It is not a number, it is neither stated nor has a default, or the mean of its
                distribution is outside of the bounds of the distribution.
        """
        if attribute not in self.attributes:
            if default is None:
                raise self.refuse("attribute-missing", "is missing", f"write {attribute} into the type", attribute)
            return default, 0.0
        text = self.attributes[attribute]
        match = _DISTRIBUTION.fullmatch(text.strip())
        parts = [part for part in match.groups() if part is not None] if match else [text, "0"]
        try:
            mean, deviation, *bounds = map(float, parts)
        except ValueError:
            mean, deviation, bounds = math.nan, math.nan, []
        if not all(map(math.isfinite, (mean, deviation, *bounds))) or deviation < 0:
            remedy = "write a number, or normc(mean, deviation, low, high)"
            raise self.refuse("not-a-number", "must be a finite number", remedy, attribute)
        if not bounds or deviation == 0:
            return mean, deviation
        low, high = (*bounds, math.inf)[:2]
        if not low <= mean <= high:
            raise self.refuse("mean-outside", "must have its mean within its bounds", "correct it", attribute)
        return _within_bounds(mean, deviation, low, high)


def _within_bounds(mean: float, deviation: float, low: float, high: float) -> tuple[float, float]:
    """Mean and standard deviation of a normal distribution that is drawn again outside of two bounds.

    Source: SUMO 1.28, `Distribution_Parameterized::sample`; moments of the truncated normal distribution.
    """
    within = truncnorm((low - mean) / deviation, (high - mean) / deviation, mean, deviation)
    return float(within.mean()), float(within.std())


def read_types(path: str | Path, pattern: str = "*") -> list[VehicleType]:
    """The vehicle types in a file of SUMO.

    Args:
        path: A route file or an additional file.
        pattern: Ids of types or of their distributions, with * and ?.

    Raises:
        MissingInputError: There is no such file.
        InvalidInputError: It is not XML, or has no such type, or types of several distributions.
    """
    path = Path(path)
    try:
        root = ET.fromstring(path.read_bytes())
    except FileNotFoundError:
        message = "must name a file that is there"
        raise MissingInputError(Problem("file-missing", message, key="sumo.file", value=str(path))) from None
    except ET.ParseError as error:
        raise InvalidInputError(Problem("not-xml", f"the file is not XML: {error}", file=str(path))) from error
    types = [
        vehicle_type
        for vehicle_type in _types(root, str(path))
        if fnmatchcase(vehicle_type.name, pattern)
        or (vehicle_type.distribution and fnmatchcase(vehicle_type.distribution, pattern))
    ]
    if not types:
        message = f"is {pattern}, which no vType of the file is called, nor a distribution of them"
        raise InvalidInputError(Problem("selects-none", message, file=str(path), key="sumo.types"))
    names = sorted({vehicle_type.distribution for vehicle_type in types})
    if len(names) > 1:
        listed = ", ".join(name or "none" for name in names)
        message = (
            f"selects types of several distributions ({listed}), whose shares of the traffic the file does not say"
        )
        remedy = "name one of them"
        raise InvalidInputError(Problem("distributions-several", message, remedy, str(path), "sumo.types"))
    return types


def _types(root: ET.Element, file: str) -> Iterator[VehicleType]:
    """All types; those that a distribution refers to by name belong to it."""
    referred: dict[str, tuple[str, str]] = {}
    for distribution in root.iter("vTypeDistribution"):
        names = distribution.get("vTypes", "").split()
        weights = distribution.get("probabilities", "").split() or ["1"] * len(names)
        name_of_distribution = distribution.get("id", "")
        # Types after the last weight do not belong to the distribution.
        referred |= {name: (name_of_distribution, weight) for name, weight in zip(names, weights, strict=False)}
        for element in distribution.iter("vType"):
            yield _type(element, name_of_distribution, element.get("probability", "1"), file)
    inside = {id(element) for distribution in root.iter("vTypeDistribution") for element in distribution.iter("vType")}
    for element in root.iter("vType"):
        if id(element) not in inside:
            yield _type(element, *referred.get(element.get("id", ""), ("", element.get("probability", "1"))), file)


def _type(element: ET.Element, distribution: str, weight: str, file: str) -> VehicleType:
    """The type of a vType element."""
    attributes = {name: value for name, value in element.attrib.items() if name not in ("id", "probability")}
    name = element.get("id", "without id")
    # The probability is parsed as any other attribute, by a record that has it among its attributes.
    stated = VehicleType(name, distribution, 0.0, attributes | {"probability": weight}, file)
    weight_value, _ = stated.number("probability")
    if weight_value < 0:
        raise stated.refuse("out-of-range", "must be at least 0", "correct it", "probability")
    return VehicleType(name, distribution, weight_value, attributes, file)
