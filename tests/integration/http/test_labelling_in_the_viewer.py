"""A label of the viewer moves the map: solved by the processes of a fleet, seen in Chromium, and taken back."""

from collections.abc import Iterator

import pytest

from viewed_maps.browser import Viewed, chromium, viewed
from viewed_maps.labelling import (
    beside_a_suggestion,
    placed_by_keyboard,
    placed_by_mouse,
    retracted,
    submitted,
    version_shown,
)
from viewed_maps.solving import solved_campus, solving

pytestmark = [pytest.mark.browser, pytest.mark.slow]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, viewer_built: None) -> Iterator[Viewed]:
    folder = tmp_path_factory.mktemp("solving")
    solved_campus(folder)
    with (
        solving(folder) as served,
        chromium() as browser,
        viewed(browser, reduced_motion="reduce") as found,
    ):
        found.open(served.url, token=served.token)
        yield found


def test_a_label_by_mouse_arrives_with_the_next_version(page: Viewed) -> None:
    before = version_shown(page)
    beside_a_suggestion(page)
    name = placed_by_mouse(page)
    submitted(page, name)
    assert version_shown(page) > before
    page.says("its 95 % radius went from")
    assert page.complaints == []


def test_a_label_by_keyboard_arrives_and_is_taken_back(page: Viewed) -> None:
    beside_a_suggestion(page)
    name = placed_by_keyboard(page)
    submitted(page, name)
    with_it = version_shown(page)
    retracted(page, name)
    assert version_shown(page) > with_it
    assert page.complaints == []
