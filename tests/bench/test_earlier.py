import json

import pytest

from rearl_jax.bench.earlier import Change, read_ratios
from rearl_jax.bench.spread import Spread
from rearl_jax.config.bench import Peer

THEN = Spread(2.0, 1.8, 2.2)


@pytest.mark.parametrize(
    ("now", "is_slower"),
    [
        (Spread(2.0, 1.9, 2.1), False),
        (Spread(1.75, 1.7, 1.8), False),  # within the margin
        (Spread(1.5, 1.4, 1.6), True),
        (Spread(1.5, 1.4, 2.1), False),  # one repetition was as fast as usual: noise
        (Spread(3.0, 2.9, 3.1), False),
    ],
)
def test_slower_is_beyond_margin_and_noise(now, is_slower):
    assert Change(10, THEN, now, 0.15).is_slower == is_slower


def test_factor_holds_all_pairs_of_repetitions():
    factor = Change(10, THEN, Spread(1.0, 0.9, 1.1), 0.15).factor
    assert (factor.median, factor.least, factor.greatest) == pytest.approx((0.5, 0.9 / 2.2, 1.1 / 1.8))


def test_ratios_are_read_from_a_file_or_its_folder(tmp_path):
    figures = {f"ratio_to_c_n{n}{end}": value for n in (10, 1000) for end, value in (("", 2), ("_min", 1), ("_max", 3))}
    file = tmp_path / "summary.json"
    file.write_text(json.dumps({"task": "bench core", **figures, "ratio_to_c_all_threads_n10": 9}))
    expected = {10: Spread(2.0, 1.0, 3.0), 1000: Spread(2.0, 1.0, 3.0)}
    assert read_ratios(str(file), Peer.c) == read_ratios(str(tmp_path), Peer.c) == expected
    with pytest.raises(ValueError, match="has no ratio to libsumo; choose another bench.reference"):
        read_ratios(str(file), Peer.libsumo)


@pytest.mark.parametrize("text", ["no JSON", "[]", '{"task": "bench loop"}'])
def test_other_files_are_refused(tmp_path, text):
    file = tmp_path / "summary.json"
    file.write_text(text)
    with pytest.raises(ValueError, match="make one with `rearl bench core study=NAME`"):
        read_ratios(str(file), Peer.c)
    with pytest.raises(FileNotFoundError, match="there is no .*nowhere"):
        read_ratios(str(tmp_path / "nowhere"), Peer.c)
