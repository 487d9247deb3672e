"""Nothing a vehicle's publisher took is lost or doubled, whatever happens to its link, its process or its peer.

One fleet goes through all of it, and what is claimed of the log is claimed of everything before as well.
"""

from collections.abc import Iterator

import pytest

from link_faults.journey import Journey, Outcome, journey_in, through_a_stop, through_cuts, through_kills


@pytest.fixture(scope="module")
def journey(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Journey]:
    with journey_in(tmp_path_factory.mktemp("journey")) as begun:
        yield begun


def assert_whole(outcome: Outcome, *, at_least: int) -> None:
    assert (outcome.lost, outcome.twice, outcome.disordered) == (0, 0, 0)
    assert outcome.taken >= at_least


def test_a_link_cut_silently_and_closed_loses_nothing(journey: Journey) -> None:
    assert_whole(through_cuts(journey, cuts=2, cut_s=1.0, rate_hz=500.0), at_least=1000)


def test_a_vehicle_killed_again_and_again_loses_nothing_it_took(journey: Journey) -> None:
    assert_whole(through_kills(journey, kills=3, rate_hz=500.0, seed=1), at_least=4)


def test_both_ends_stopped_past_zenoh_s_close_lose_nothing(journey: Journey) -> None:
    assert_whole(through_a_stop(journey, stop_s=6.0, rate_hz=2000.0), at_least=2000)


@pytest.mark.slow
def test_a_link_away_for_longer_than_zenoh_s_lease_loses_nothing(journey: Journey) -> None:
    assert_whole(through_cuts(journey, cuts=2, cut_s=15.0, rate_hz=500.0), at_least=1000)
