"""Files in the folder of SUMO's floating car data: vehicle lengths by type, and lanes of the network."""

from dataclasses import dataclass, field
from pathlib import Path

from rearl_jax.data.files.folder import visible_files
from rearl_jax.data.formats.sumo_fcd import ROOT
from rearl_jax.data.formats.sumo_xml import XML, CutOff, elements, root_of
from rearl_jax.data.problems import bad_recording

NETWORK = "net"
_TYPES = ("routes", "additional")
_PASSED_OVER = frozenset(
    "configuration sumoConfiguration netconvertConfiguration viewsettings nodes edges connections types tlLogics "
    "tripinfos summary edgeData meandata netstate queue-export emission-export collisions lanechanges "
    "statistics".split()
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


@dataclass
class Surroundings:
    """Types of vehicles, and by edge the number of lanes and the speed limit [m/s]; the widths of all lanes [m]."""

    types: dict[str, VehicleType] = field(default_factory=dict)
    lanes: dict[str, int] = field(default_factory=dict)
    limits: dict[str, float] = field(default_factory=dict)
    widths: set[float] = field(default_factory=set)

    @property
    def lane_width(self) -> float | None:
        """Width of every lane [m]; None if they differ."""
        return next(iter(self.widths or {LANE_WIDTH})) if len(self.widths) < 2 else None


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
    """Content of the files of networks and vehicle types.

    Raises:
        BadRecordingError: A file is damaged, or a length, width or speed is not a number.
    """
    found = Surroundings()
    found.types["DEFAULT_VEHTYPE"] = VehicleType("passenger", *SIZES["passenger"])
    for path in files:
        edge = ""
        try:
            for name, attributes in elements(path):
                if name == "vType" and "id" in attributes:
                    found.types[attributes["id"]] = _type_of(attributes, path)
                elif name == "edge":
                    edge = attributes.get("id", "")
                elif name == "lane":
                    found.lanes[edge] = found.lanes.get(edge, 0) + 1
                    found.limits[edge] = _number(attributes, "speed", path) or 0.0
                    # Lanes of junctions have widths of their own.
                    if not edge.startswith(":"):
                        found.widths.add(_number(attributes, "width", path) or LANE_WIDTH)
        except CutOff as cut:
            text, remedy = "the file ends within an element", "write or copy it again"
            raise bad_recording("line-broken", text, remedy, path, line=cut.line) from None
    return found


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
        return float(attributes[name])
    except ValueError:
        text = f"{attributes[name]!r} is not a number"
        raise bad_recording("value-unreadable", text, "write a number there", path, column=name) from None
