"""Notes on recordings as the page of a study shows them."""

from rearl_jax.document.recording_notes import merged_notes


def test_notes_that_differ_only_in_numbers_become_one_with_ranges():
    of_recordings = [("a proving ground", f"{n} speeds in holes of 1 s, {n / 2:g} m apart") for n in (81, 3, 22)]
    assert merged_notes(of_recordings) == (
        "a proving ground",
        "3 to 81 speeds in holes of 1 s, 1.5 to 40.5 m apart (3 recordings)",
    )


def test_every_recording_with_a_merged_note_counts():
    assert merged_notes([("1 gap",), ("2 gaps",), ("1 gap",), ("3 gaps", "3 gaps"), ("4 gaps",)]) == (
        "1 gap",
        "2 to 4 gaps (3 recordings)",
    )


def test_few_notes_and_numbers_in_names_stay_as_they_are():
    notes = ("2 leaders are absent", "1 leaders are absent", *(f"part{n} contains part{n - 1}" for n in (9, 7, 5)))
    assert merged_notes([(note,) for note in notes]) == notes
