"""Properties of all figures: size, sameness, and the mark of generated data."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from rearl_jax import drawing


def pixels(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(BytesIO(png)).convert("RGB")).astype(int)


def drawn(*, generated: bool = False) -> bytes:
    figure, axes = drawing.panels(3.0, 2.0, columns=2, generated=generated)
    axes[0].plot([0, 1], [0, 1], color=drawing.BLUE)
    drawing.set_title(axes[1], "a title")
    return drawing.png(figure)


def test_the_same_figure_is_the_same_file_of_the_stated_size():
    png = drawn()
    assert png == drawn()
    assert pixels(png).shape == (400, 600, 3)
    assert Image.open(BytesIO(png)).info.keys() == {"dpi"}


def test_generated_data_are_marked_in_red():
    def red(png: bytes) -> int:
        return int((np.abs(pixels(png) - (0xB0, 0x00, 0x20)).max(axis=-1) < 10).sum())

    assert red(drawn()) == 0
    assert red(drawn(generated=True)) > 100


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (3, 1), (1, 2)])
def test_rows_share_their_horizontal_scale(rows, columns):
    _, axes = drawing.panels(3.0, 2.0, rows=rows, columns=columns, generated=False)
    assert len(axes) == rows * columns
    axes[0].set_xlim(0, 7)
    assert [panel.get_xlim() == (0, 7) for panel in axes] == [True] + [rows > 1] * (len(axes) - 1)


def test_the_colours_differ():
    names = [name for name in vars(drawing) if name.isupper() and isinstance(getattr(drawing, name), str)]
    assert len(names) == 10
    assert len({getattr(drawing, name) for name in names}) == 10
