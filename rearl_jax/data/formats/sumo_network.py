"""Files in the folder of SUMO's floating car data: vehicle lengths by type, and lanes of the network."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rearl_jax.data.files.folder import visible_files
from rearl_jax.data.formats.sumo_fcd import ROOT
from rearl_jax.data.formats.sumo_xml import XML, CutOff, elements, root_of
from rearl_jax.data.problems import bad_recording

NETWORK = "net"
_TYPES = ("routes", "additional")
_PASSED_OVER = frozenset(
    "configuration sumoConfiguration netconvertConfiguration viewsettings nodes edges connections types tlLogics "
    "tripinfos summary personSummary edgeData meandata netstate queue-export emission-export collisions lanechanges "
    "statistics detector e3Detector instantE1 vehicle-type-probes full-export link-output trajectories snapshot stops "
    "SSMLog tlsStates tazs data battery-export bt-output chargingstations-export elecHybrid-export "
    "railsignal-block-output".split()
)
"""First elements of SUMO's other files, which are often in the same folder and are ignored."""

_CARS = ("passenger", "private", "taxi", "evehicle", "hov", "vip", "army", "authority")
SIZES = {
    **dict.fromkeys(_CARS, (5.0, 1.8)),
    **dict.fromkeys(("custom1", "custom2"), (5.0, 1.8)),
    **dict.fromkeys(("delivery", "emergency"), (6.5, 2.16)),
    "truck": (7.1, 2.4),
    "trailer": (16.5, 2.55),
    "bus": (12.0, 2.5),
    "coach": (14.0, 2.6),
    "motorcycle": (2.2, 0.9),
    "moped": (2.1, 0.78),
    "scooter": (1.2, 0.5),
    "bicycle": (1.6, 0.65),
}
"""Length and width [m] that SUMO gives to a type of a vehicle class if it states none.

Source: libsumo 1.28, `vehicletype.getLength` and `getWidth` of a type of each class.
"""
LANE_WIDTH = 3.2
"""Width [m] of lanes that state none. Source: SUMO documentation, Networks/PlainXML, default lane width."""
CLASS = {
    **dict.fromkeys((*_CARS, "delivery", "emergency"), "car"),
    **dict.fromkeys(("truck", "trailer", "bus", "coach"), "truck"),
    **dict.fromkeys(("motorcycle", "moped", "scooter"), "motorcycle"),
}
"""Canonical class of SUMO's vehicle classes; all others are `other`."""


@dataclass(frozen=True)
class VehicleType:
    """A type of vehicles: SUMO's class, length and width [m]; None if neither the type nor its class states them."""

    vehicle_class: str
    length: float | None
    width: float | None


@dataclass(frozen=True)
class Edge:
    """Limits [m/s] and widths [m] of the lanes of an edge, from right to left; a limit of 0 is not stated."""

    limits: tuple[float, ...] = ()
    widths: tuple[float, ...] = ()


@dataclass
class Surroundings:
    """Types of vehicles and edges by their ids."""

    types: dict[str, VehicleType] = field(default_factory=dict)
    edges: dict[str, Edge] = field(default_factory=dict)

    @property
    def lanes(self) -> dict[str, int]:
        """Number of lanes of each edge."""
        return {name: len(edge.limits) for name, edge in self.edges.items()}

    @property
    def limits(self) -> dict[str, float]:
        """Speed limit of each edge [m/s], the largest of its lanes.

        Lanes may have limits of their own: bus lanes, hard shoulders and pavements have lower ones.
        """
        return {name: max(edge.limits) for name, edge in self.edges.items()}

    @property
    def lane_width(self) -> float | None:
        """Width of every lane [m]; None if they differ."""
        # Lanes of junctions have widths of their own.
        widths = {width for name, edge in self.edges.items() if not name.startswith(":") for width in edge.widths}
        return next(iter(widths or {LANE_WIDTH})) if len(widths) < 2 else None


def sorted_files(folder: Path) -> tuple[list[Path], list[Path]]:
    """XML files of floating car data in the folder, and those of networks and types.

    Raises:
        BadRecordingError: A file is neither, nor another known one of SUMO.
    """
    recordings, beside = [], []
    for path in visible_files(folder, XML):
        root = root_of(path)
        if root in (NETWORK, *_TYPES):
            beside.append(path)
        elif root is None or root == ROOT:
            # A file without a first element is damaged; its reader reports it.
            recordings.append(path)
        elif root not in _PASSED_OVER:
            text = f"the file holds {root}, which is not an output of SUMO that is known here"
            raise bad_recording("not-a-table", text, "move it out of the folder", path)
    return recordings, beside


def surroundings_of(files: list[Path]) -> Surroundings:
    """Content of the files of networks and vehicle types; what two files state alike counts once.

    Raises:
        BadRecordingError: A file is damaged, a length, width or speed is not a number, or an edge or a type is stated
            twice and differently.
    """
    found = Surroundings({"DEFAULT_VEHTYPE": VehicleType("passenger", *SIZES["passenger"])})
    stated: dict[tuple[str, str], tuple[Edge | VehicleType, Path]] = {}
    for path in files:
        try:
            for name, content in _content_of(path):
                kind = "edge" if isinstance(content, Edge) else "type"
                earlier, there = stated.setdefault((kind, name), (content, path))
                if earlier != content:
                    text = f"the {kind} {name} is stated twice and differently, the first time in {there.name}"
                    remedy = "leave only the files of this simulation in the folder, or correct one of the two"
                    raise bad_recording(f"{kind}-contradicts", text, remedy, path)
                if isinstance(content, Edge):
                    found.edges[name] = content
                else:
                    found.types[name] = content
        except CutOff as cut:
            text, remedy = "the file ends within an element", "write or copy it again"
            raise bad_recording("line-broken", text, remedy, path, line=cut.line) from None
    return found


def _content_of(path: Path) -> Iterator[tuple[str, Edge | VehicleType]]:
    """Ids and properties of the edges with lanes and of the vehicle types of a file."""
    edge, lanes = "", Edge()
    for name, attributes in elements(path):
        if name == "vType" and "id" in attributes:
            yield attributes["id"], _type_of(attributes, path)
        elif name == "edge":
            if lanes.limits:
                yield edge, lanes
            edge, lanes = attributes.get("id", ""), Edge()
        elif name == "lane":
            limit = _number(attributes, "speed", path) or 0.0
            width = _number(attributes, "width", path) or LANE_WIDTH
            lanes = Edge((*lanes.limits, limit), (*lanes.widths, width))
    if lanes.limits:
        yield edge, lanes


def _type_of(attributes: dict[str, str], path: Path) -> VehicleType:
    """The vehicle type of a vType element; sizes that it does not state are those of its class."""
    vehicle_class = attributes.get("vClass", "passenger")
    length, width = SIZES.get(vehicle_class, (None, None))
    own_length, own_width = _number(attributes, "length", path), _number(attributes, "width", path)
    return VehicleType(
        vehicle_class,
        length if own_length is None else own_length,
        width if own_width is None else own_width,
    )


def _number(attributes: dict[str, str], name: str, path: Path) -> float | None:
    if name not in attributes:
        return None
    try:
        number = float(attributes[name])
    except ValueError:
        number = np.nan
    if not np.isfinite(number):
        text = f"{attributes[name]!r} is not a number"
        raise bad_recording("value-unreadable", text, "write a number there", path, column=name)
    return number
