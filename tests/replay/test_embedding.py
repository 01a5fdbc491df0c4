"""The data of the player: nothing in it can break out of its element, no rounding adds up."""

import json

import numpy as np
import pytest

from rearl_jax.replay.embedding import differences, embedded, positions


@pytest.mark.parametrize("text", ["</script><script>", "<!--<script>", "]]>", "\u2028\u2029", "&quot;'\""])
def test_embedded_json_stays_inside_its_element(text):
    written = embedded({text: [text, 1.5, None]})
    assert not set("<>&'\u2028\u2029") & set(written)
    assert json.loads(written) == {text: [text, 1.5, None]}


def test_embedded_json_refuses_what_browsers_cannot_read():
    with pytest.raises(ValueError, match="JSON compliant"):
        embedded({"x": float("nan")})


def test_differences_are_whole_centimetres_whose_errors_do_not_add_up():
    x = 100.0 + np.cumsum(np.full(2000, 0.00349))  # less than half a centimetre each
    steps = differences(x)
    assert set(map(type, steps)) == {int}
    assert max(abs(np.diff(steps))[1:]) == 1
    np.testing.assert_allclose(positions(steps), x, atol=0.00501)
    assert differences(np.zeros(0)) == []
