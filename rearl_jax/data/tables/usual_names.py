"""Usual names of the canonical columns in tables, and units that are part of names."""

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence

from rearl_jax.data.units import UNITS, unit_named

ALIASES = {
    "track_id": (
        "track_id track trackid vehicle_id vehicleid veh_id vehid vehicle_number vehicle_no vehno vid veh vehicle "
        "car_id carid object_id objectid obj_id target_id traj_id trajectory_id agent_id actor_id tid uuid id car "
        "object no number fahrzeug_id fahrzeug_nummer fahrzeug_nr fahrzeug fzg_id fzg vehicule id_vehicule"
    ),
    "frame": (
        "frame frame_id frameid frame_no frame_number frame_num framenum frame_index frame_idx framenr bild step "
        "timestep tick"
    ),
    "time": (
        "time t timestamp time_stamp ts global_time globaltime unix_time unixtime epoch epoch_time datetime "
        "date_time utc utc_time sim_time simsec simulation_time elapsed elapsed_time recording_time seconds sec "
        "clock time_of_day millis zeit zeitstempel uhrzeit simulationssekunde simsek temps horodatage heure"
    ),
    "position": (
        "position pos local_y localy longitudinal longitudinal_position long_pos longpos lon_pos station chainage "
        "s distance dist distance_along along arc_length travelled x_position xposition x_pos xpos pos_x "
        "position_x x_center xcenter x_centre x_coord xloc x y_position y_pos pos_y y weg abscisse"
    ),
    "lateral": (
        "lateral lateral_position lateral_pos lat_pos latpos lateral_offset local_x localx y_position yposition "
        "y_pos ypos pos_y position_y y_center ycenter y_centre y_coord yloc y offset across d querablage x"
    ),
    "lane": "lane lane_id laneid lane_no lane_number lane_num lane_index lane_nr lanenr fahrstreifen spur voie",
    "speed": (
        "speed v vel velocity v_vel spd speed_x x_velocity xvelocity x_speed vel_x velocity_x v_x vx "
        "longitudinal_velocity lon_velocity long_speed lon_speed geschwindigkeit geschw vitesse"
    ),
    "acceleration": (
        "acceleration acc accel v_acc a x_acceleration xacceleration acc_x a_x ax longitudinal_acceleration "
        "lon_acceleration long_acc lon_acc beschleunigung"
    ),
    "length": "length len v_length vehicle_length veh_length car_length object_length laenge lange longueur",
    "width": "width v_width vehicle_width veh_width car_width object_width breite largeur",
    "vehicle_class": (
        "vehicle_class class v_class veh_class class_name object_class agent_type vehicle_type veh_type type "
        "category classification fahrzeugtyp fahrzeugklasse typ klasse"
    ),
    "leader_id": (
        "leader_id leader preceding preceding_id precedingid preceeding preceding_vehicle lead_id lead "
        "lead_vehicle leading_id front_id front_vehicle vorausfahrender"
    ),
    "direction": "direction driving_direction drivingdirection dir travel_direction carriageway roadway richtung",
    "recording": "recording recording_id recordingid run run_id session session_id scenario video segment file",
}
"""Names of each canonical column, the most specific first; case, blanks and punctuation do not count."""

_ORDER = {
    name: {re.sub("_", "", alias): rank for rank, alias in enumerate(text.split())} for name, text in ALIASES.items()
}
_ENDS = {"front": {"front", "head", "nose"}, "rear": {"rear", "back", "tail"}}
_PIXELS = {"px", "pix", "pixel", "pixels"}
_ON_GLOBE = {"lat", "latitude", "lon", "lng", "longitude"}
_BRACKETS = re.compile(r"[\[(<{]([^\])>}]*)[\])>}]")


def plain_of(name: str) -> str:
    """A name in lower case without punctuation, brackets and unit: `Speed [km/h]` and `speed_kmh` are speed."""
    words = _words(name)
    if len(words) > 1 and _is_unit(words[-1]):
        words = words[:-1]
    return "".join(words)


def rank_of(name: str, canonical: str) -> int | None:
    """Place of a name among those of a canonical column, 0 = the most specific; None if it is none of them."""
    order = _ORDER[canonical]
    whole = "".join(_words(name))
    return order.get(whole, order.get(plain_of(name)))


def unit_in(name: str, kind: str) -> str | None:
    """Unit of a kind, a key of UNITS, that a name states, in brackets or as its last word; None for none."""
    words = _words(name)
    candidates = [*_BRACKETS.findall(name), *words[1:][-1:]]
    if "_" in name:
        candidates.append("/".join(words[-2:]))
    return next((unit for text in candidates if (unit := unit_named(text.strip(), kind)) is not None), None)


def end_in(name: str) -> str | None:
    """The end of the vehicle that a name of positions contains: front or rear; None for neither."""
    words = set(_words(name))
    return next((end for end, words_of_end in _ENDS.items() if words & words_of_end), None)


def is_on_globe(name: str) -> bool:
    """True if a name says that a column holds latitudes or longitudes."""
    return bool(_ON_GLOBE & set(_words(name)))


def per_vehicle(names: Sequence[str]) -> list[str]:
    """Names that differ in a number only, as in tables with separate columns for every vehicle: x1, x2."""
    stems = [re.sub(r"[\W_]*\d+$", "", _BRACKETS.sub("", name).strip()).casefold() for name in names]
    numbered = [bool(re.search(r"\d$", _BRACKETS.sub("", name).strip())) for name in names]
    counts = Counter(stem for stem, is_numbered in zip(stems, numbered, strict=True) if is_numbered)
    columns = zip(names, stems, numbered, strict=True)
    return [name for name, stem, is_numbered in columns if is_numbered and counts[stem] > 1]


def is_in_pixels(name: str) -> bool:
    """True if a name says that a column is in pixels of a picture."""
    return bool(_PIXELS & set(_words(" ".join([name, *_BRACKETS.findall(name)]))))


def _words(name: str) -> list[str]:
    """The words of a name in lower case, without accents and text in brackets: `xVelocity` is x and velocity."""
    without = _BRACKETS.sub(" ", name)
    split = re.sub(r"([a-z])([A-Z])", r"\1 \2", without).casefold()
    for letter, plain in (("ä", "ae"), ("ö", "oe"), ("ü", "ue"), ("ß", "ss")):
        split = split.replace(letter, plain)
    split = "".join(letter for letter in unicodedata.normalize("NFD", split) if not unicodedata.combining(letter))
    return re.findall(r"[^\W_]+", split)


def _is_unit(word: str) -> bool:
    return any(unit_named(word, kind) for kind in UNITS if kind != "1/s")
