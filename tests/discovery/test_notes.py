"""Notes on many recordings at once."""

from rearl_jax.discovery.compute import _each_once


def test_notes_that_differ_in_numbers_only_stand_once():
    notes = ["5 holes of 1 s or less", "cut lanes", "3 holes of 1 s or less", "5 holes of 1 s or less", "cut lanes"]
    assert _each_once(notes) == ("5 holes of 1 s or less (and 1 alike with other numbers)", "cut lanes")
