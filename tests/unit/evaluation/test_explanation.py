"""What saw a landmark, gathered from its rows."""

from landmark_maps.examples import landmark
from trigpoint.landmarks.model import Landmark
from trigpoint_evaluation.core.explanation import rows_behind, sweeps_of


def row(opened: int, until: int | None, *sequences: int) -> Landmark:
    provenance = f'{{"veh-a/boot-1": {list(sequences)}}}' if sequences else "{}"
    return landmark("L1", 1.0, 2.0)._replace(valid_from_version=opened, valid_to_version=until, provenance=provenance)


WHOLE, MORE, MOVED, NEXT_WHOLE = row(1, 2, 3, 4), row(2, 3, 4, 5), row(3, 6), row(6, None, 9)
HISTORY = (WHOLE, MORE, MOVED, NEXT_WHOLE)


def test_rows_since_the_whole_version_tell_together_what_saw_a_landmark() -> None:
    rows = rows_behind(HISTORY, whole=1, map_version=4)
    assert rows == [WHOLE, MORE, MOVED]
    assert sweeps_of(rows) == {("veh-a", "boot-1"): [3, 4, 5]}


def test_what_an_earlier_whole_version_said_does_not_count() -> None:
    assert rows_behind(HISTORY, whole=6, map_version=7) == [NEXT_WHOLE]


def test_a_row_kept_by_the_whole_version_is_behind_it() -> None:
    assert rows_behind((row(1, None, 3),), whole=5, map_version=8) == [row(1, None, 3)]


def test_a_landmark_that_was_gone_begins_anew() -> None:
    again = row(5, None, 8)
    assert rows_behind((WHOLE, MORE, again), whole=1, map_version=6) == [again]
