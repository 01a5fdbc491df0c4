"""Pictures of the road around the controlled vehicle, as arrays, in the colours of the replay on the pages of results.

Vehicles are rectangles along the road with a mark at the front. The controlled vehicle has a colour of its own,
crashed vehicles have a frame, and replayed vehicles are grey. Drawn with NumPy alone: a picture takes less than a
millisecond.
"""

from typing import Any, TypeAlias

import numpy as np
from jaxtyping import UInt8

from rearl_jax.core.replayed import NOT_RECORDED
from rearl_jax.core.state import Controller
from rearl_jax.environments.highway import EGO, HighwayOptions, HighwayState
from rearl_jax.problems import out_of_range

RENDER_MODES = ("rgb_array",)
"""Supported render modes."""

FRAMES_PER_SECOND = 1
"""Pictures in a second of the traffic: one after every action."""

Colour: TypeAlias = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""

_SCALE = 5
"""Pixels per metre."""

_SHOWN_LENGTH = 200.0
"""Length of the road that is shown [m]; the controlled vehicle is in the middle."""

_MARGIN = 10
"""Space beside the road [pixels]."""

_MARK_LENGTH = 0.6
"""Length of the mark at the front [m]; the mark begins 1.7 m behind the front."""

_EDGE, _FRAME = 0.4, 1.6
"""Edge of a vehicle and frame around a crashed vehicle: difference of the outer and the inner size [m]."""

_BACKGROUND, _ROAD, _LINE = (255, 255, 255), (0xE9, 0xEC, 0xEF), (0xAA, 0xB2, 0xBB)
_CAR, _CAR_EDGE = (0x2F, 0x6F, 0xB0), (0x16, 0x32, 0x4F)
_REPLAYED, _REPLAYED_EDGE = (0xC4, 0xCB, 0xD2), (0x5B, 0x63, 0x6D)
_EGO, _EGO_EDGE = (0xF0, 0x8A, 0x00), (0x1F, 0x23, 0x28)
_CRASHED = (0xC2, 0x18, 0x3D)


def check_render_mode(mode: str | None) -> str | None:
    """The mode, or None for no pictures.

    Raises:
        InvalidInputError: There is no such mode.
    """
    if mode is not None and mode not in RENDER_MODES:
        raise out_of_range("render_mode", f"must be {' or '.join(RENDER_MODES)}, or None", repr(mode))
    return mode


def metadata(**others: Any) -> dict[str, Any]:
    """Metadata of an environment for Gymnasium: render modes, frame rate, and further entries."""
    return {"render_modes": list(RENDER_MODES), "render_fps": FRAMES_PER_SECOND} | others


def pictures(state: HighwayState, options: HighwayOptions) -> list[UInt8[np.ndarray, "height width 3"]]:
    """A picture of every scenario, the scenario axis of the state last."""
    traffic, body, model = state.traffic, state.drivers.body, options.model
    x, y, controller, crashed, length, width = np.broadcast_arrays(
        *(traffic.x, traffic.y, traffic.controller, traffic.crashed, body.length, body.width)
    )
    road = _road(model.n_lanes, model.lane_width)
    drawn_pictures = []
    for number in range(x.shape[-1]):
        left = float(x[EGO, number]) - _SHOWN_LENGTH / 2
        picture = _with_lines(road.copy(), model.n_lanes, model.lane_width, left)
        _draw_replayed(picture, state, number, left, model.lane_width)
        # The controlled vehicle is drawn last, so that no other vehicle hides it.
        for vehicle in np.flatnonzero(controller[:, number] != int(Controller.ABSENT))[::-1]:
            centre = (float(x[vehicle, number]) - left, float(y[vehicle, number]) + model.lane_width / 2)
            size = (float(length[vehicle, number]), float(width[vehicle, number]))
            colours = (_EGO, _EGO_EDGE) if vehicle == EGO else (_CAR, _CAR_EDGE)
            _draw_vehicle(picture, centre, size, colours, is_crashed=bool(crashed[vehicle, number]))
        drawn_pictures.append(picture)
    return drawn_pictures


def _road(n_lanes: int, lane_width: float) -> UInt8[np.ndarray, "height width 3"]:
    height = round(n_lanes * lane_width * _SCALE)
    picture = np.full((height + 2 * _MARGIN, round(_SHOWN_LENGTH * _SCALE), 3), _BACKGROUND, np.uint8)
    picture[_MARGIN : _MARGIN + height] = _ROAD
    return picture


def _with_lines(picture: np.ndarray, n_lanes: int, lane_width: float, left: float) -> np.ndarray:
    """The picture with the edges of the road and, between lanes, dashes of 3 m every 9 m, fixed to the road.

    `left` is the position along the road of the left edge of the picture [m].
    """
    along = (np.arange(picture.shape[1]) / _SCALE + left) % 9.0 < 3.0
    for lane in range(n_lanes + 1):
        row = _MARGIN + round(lane * lane_width * _SCALE)
        picture[row, slice(None) if lane in (0, n_lanes) else along] = _LINE
    return picture


def _draw_replayed(picture: np.ndarray, state: HighwayState, number: int, left: float, lane_width: float) -> None:
    """Draws the recorded vehicles around a scenario, in the middle of their lanes."""
    if state.replayed is None:
        return
    x, lane, length = (
        np.asarray(values)[:, number] for values in (state.replayed.x, state.replayed.lane, state.replayed.length)
    )
    width = float(np.asarray(state.drivers.body.width).flat[0])
    for slot in np.flatnonzero(lane != NOT_RECORDED):
        centre = (float(x[slot]) - left, (float(lane[slot]) + 0.5) * lane_width)
        _draw_vehicle(picture, centre, (float(length[slot]), width), (_REPLAYED, _REPLAYED_EDGE), is_crashed=False)


def _draw_vehicle(
    picture: np.ndarray,
    centre: tuple[float, float],
    size: tuple[float, float],
    colours: tuple[Colour, Colour],
    *,
    is_crashed: bool,
) -> None:
    """Draws a vehicle centred at a point of the picture [m], given length and width [m], colours of body and edge."""
    (x, y), (length, width), (body, edge) = centre, size, colours
    if is_crashed:
        _fill(picture, x, y, length + _FRAME, width + _FRAME, _CRASHED)
    _fill(picture, x, y, length, width, edge)
    _fill(picture, x, y, length - _EDGE, width - _EDGE, body)
    _fill(picture, x + length / 2 - 1.7 + _MARK_LENGTH / 2, y, _MARK_LENGTH, 0.8 * width, edge)


def _fill(picture: np.ndarray, x: float, y: float, length: float, width: float, colour: Colour) -> None:
    """Fills a rectangle centred at a point of the picture [m], where it lies within the picture."""
    first_column, last_column = (max(round((x + side * length / 2) * _SCALE), 0) for side in (-1, 1))
    first_row, last_row = (max(round((y + side * width / 2) * _SCALE) + _MARGIN, 0) for side in (-1, 1))
    picture[first_row:last_row, first_column:last_column] = colour
