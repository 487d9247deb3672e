"""The viewer in Chromium on a map of two versions: looked at, read, labelled in, and left without its service."""

import json
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from command_runs.processes import wait_until
from landmark_maps.examples import checkpoint, pin_frame
from map_features.examples import anchor, two_versions
from map_http.served import ServedMap, geopackage_line, served_map
from registered_images.examples import registered, tile
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.model import MapChange
from trigpoint.logs.mcap_log import McapLog
from trigpoint_landmarks.http.tokens import Scope, issue_token
from trigpoint_optimisation.settings import SolveSettings, settings_json
from trigpoint_tiles.check_layer_files import write_check_layer
from viewed_maps.browser import Viewed, chromium, viewed

pytestmark = pytest.mark.browser

MARKUP = "<img src=x onerror=alert(1)>"
TABS = ("Layers", "Label", "Next", "List")


@dataclass(frozen=True, slots=True)
class Labelled:
    """A served map, and a token to label with."""

    served: ServedMap
    token: str


def solved(change: MapChange) -> MapChange:
    """The same, with how it was solved: that says how labels find their landmarks."""
    return replace(change, version=replace(change.version, settings_json=settings_json(SolveSettings())))


@pytest.fixture(scope="module")
def browser(viewer_built: None) -> Iterator[Browser]:
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def map_served(tmp_path_factory: pytest.TempPathFactory, viewer_built: None) -> Iterator[Labelled]:
    folder = tmp_path_factory.mktemp("viewed")
    with closing(McapLog(folder / "data" / "log")) as log:
        pin_frame(log)
    path = folder / "data" / "landmarks.gpkg"
    first, second = two_versions()
    with closing(GeoPackageStore(path)) as store:
        store.apply(solved(replace(first, anchors=(*first.anchors, anchor(MARKUP)))), checkpoint(1))
        store.apply(solved(second), checkpoint(2))
    (folder / "data" / "shifts").mkdir()
    tiles = registered(tile(-1, (0.3, -0.2)), tile(0, (-0.6, 0.5)), tile(1, (0.0, 0.0), refused="few edges"))
    write_check_layer(folder / "data" / "shifts" / "north.geojson", tiles, image="north")
    tokens = folder / "tokens.json"
    _, token = issue_token(tokens, "ann", Scope.LABEL, now_s=0)
    web = f"token_file = {json.dumps(str(tokens))}\nopen_reading = true"
    with served_map(folder, database=geopackage_line(path), web=web, data=folder / "data") as served:
        yield Labelled(served, token)


@pytest.fixture
def page(browser: Browser, map_served: Labelled) -> Iterator[Viewed]:
    with viewed(browser) as found:
        found.open(map_served.served.url)
        yield found


def beside_a_landmark(shown: Viewed) -> str:
    """The map gone to the first landmark of the list; its id."""
    shown.tab("List")
    row = shown.page.locator(".rows .row").first
    name = row.locator("span").evaluate("one => one.firstChild.textContent")
    row.press("Enter")
    shown.page.wait_for_function("() => document.querySelector('.details h2')?.textContent.length > 0")
    return str(name)


def test_the_map_is_drawn_without_a_complaint_and_from_nowhere_else(browser: Browser, map_served: Labelled) -> None:
    with viewed(browser) as found:
        asked: list[str] = []
        found.page.on("request", lambda request: asked.append(request.url))
        found.open(map_served.served.url)
        found.says("Version 2, the newest")
        expect(found.page.locator(".status")).to_contain_text("Live")
        assert found.complaints == []
        assert {url for url in asked if not url.startswith((map_served.served.url, "blob:"))} == set()


def test_an_older_version_is_shown_with_the_slider_s_keys(page: Viewed) -> None:
    before = page.pixels()
    with page.page.expect_request("**/v/1/tiles/landmarks/**"):
        page.page.get_by_role("slider", name="Map version").press("ArrowLeft")
    page.says("Version 1 of 2")
    expect(page.page.get_by_role("switch", name="Follow live")).not_to_be_checked()
    wait_until(lambda: page.pixels() != before, "another picture")
    page.page.get_by_role("switch", name="Follow live").check()
    page.says("Version 2, the newest")
    assert page.complaints == []


def test_layers_are_switched_off_and_on(page: Viewed) -> None:
    before = page.pixels()
    page.page.get_by_role("checkbox", name="Landmarks").uncheck()
    expect(page.page.get_by_role("checkbox", name="Landmarks")).not_to_be_checked()
    wait_until(lambda: page.pixels() != before, "another picture")
    page.page.get_by_role("checkbox", name="Optimised paths").press("Space")
    expect(page.page.get_by_role("checkbox", name="Optimised paths")).not_to_be_checked()


def test_an_image_s_shift_is_switched_on_and_read_tile_by_tile(page: Viewed) -> None:
    before = page.pixels()
    page.page.get_by_role("checkbox", name="Shift of north").check()
    page.says("2 of 3 tiles tell; map version 3")
    wait_until(lambda: page.pixels() != before, "another picture")
    with page.page.expect_response("**/collections/landmarks/items**"):  # what the list opens with
        page.tab("List")
    page.page.get_by_label("Show", exact=True).select_option("shift")
    page.page.get_by_role("button", name="off by 0.78 m").press("Enter")
    details = page.page.get_by_role("region", name="Details")
    expect(details).to_contain_text("-0.60 m grid east, 0.50 m grid north of the layer")
    page.page.get_by_role("button", name="few edges").press("Enter")
    expect(details).to_contain_text("refused")
    assert page.violations() == []
    assert page.complaints == []


def test_every_fact_of_a_landmark_is_read_by_keyboard(page: Viewed) -> None:
    name = beside_a_landmark(page)
    details = page.page.get_by_role("region", name="Details")
    expect(details).to_contain_text(name)
    expect(details).to_contain_text("95 % ellipse")
    expect(details).to_contain_text("Observed")
    details.get_by_role("button", name="Close details").press("Enter")
    expect(details).to_be_hidden()


def test_a_landmark_that_is_clicked_on_shows_its_facts(page: Viewed) -> None:
    name = beside_a_landmark(page)
    page.page.get_by_role("button", name="Close details").click()
    box = page.page.locator(".canvas").bounding_box()
    assert box is not None

    def clicked() -> bool:
        page.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        return page.page.get_by_role("region", name="Details").filter(has_text=name).is_visible()

    wait_until(clicked, "the landmark in the middle of the map")


def test_text_of_the_map_is_never_markup(page: Viewed) -> None:
    page.page.get_by_role("slider", name="Map version").press("ArrowLeft")
    page.says("Version 1 of 2")
    page.tab("List")
    page.page.get_by_label("Show", exact=True).select_option("anchor")
    page.page.get_by_role("button", name=MARKUP).click()
    expect(page.page.get_by_role("region", name="Details").get_by_role("heading")).to_contain_text(MARKUP)
    assert page.page.locator("img[src='x']").count() == 0


def test_without_a_token_the_page_says_what_one_is_needed_for(page: Viewed) -> None:
    page.tab("Label")
    page.says("a token with scope 'label' is needed")
    expect(page.page.get_by_role("button", name="Submit label")).to_be_disabled()


def test_a_token_that_is_entered_stays_in_the_tab(page: Viewed, map_served: Labelled) -> None:
    page.tab("Label")
    page.page.get_by_label("Token", exact=True).last.fill(map_served.token)
    page.page.get_by_role("button", name="Use it").click()
    page.says("Labelling as ann.")
    assert page.page.evaluate("[localStorage.length, document.cookie]") == [0, ""]
    page.page.get_by_role("button", name="Forget the token").click()
    page.says("a token with scope 'label' is needed")


def test_a_label_moved_by_keys_says_what_it_would_be_tied_to(page: Viewed) -> None:
    name = beside_a_landmark(page)
    page.page.get_by_role("button", name="Label an anchor here").press("Enter")
    marker = page.page.get_by_role("button", name="Label position")
    expect(marker).to_be_focused()
    expect(page.page.locator(".verdict")).to_contain_text(name)
    latitude = page.page.get_by_label("Latitude").input_value()
    marker.press("Shift+ArrowUp")
    expect(page.page.get_by_label("Latitude")).not_to_have_value(latitude)
    expect(page.page.locator(".verdict")).to_contain_text("1.0")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nobody_is_shut_out(browser: Browser, map_served: Labelled, scheme: str) -> None:
    with viewed(browser, color_scheme=scheme) as found:
        found.open(map_served.served.url)
        beside_a_landmark(found)
        for tab in TABS:
            found.tab(tab)
            assert found.violations() == []


def test_a_telephone_s_width_is_enough(browser: Browser, map_served: Labelled) -> None:
    with viewed(browser, width=360, height=740) as found:
        found.open(map_served.served.url)
        for tab in TABS:
            found.tab(tab)
            assert found.page.evaluate("document.documentElement.scrollWidth") <= 360
        assert found.violations() == []


def test_a_service_that_is_gone_is_said_to_be(tmp_path: Path, browser: Browser) -> None:
    path = tmp_path / "map.gpkg"
    with closing(GeoPackageStore(path)) as store:
        store.apply(two_versions()[0], checkpoint(1))
    with served_map(tmp_path, database=geopackage_line(path)) as served, viewed(browser) as found:
        found.open(served.url)
        assert found.complaints == []
        served.popen.terminate()
        served.popen.wait(30.0)
        found.says("Offline since")
        found.says("what is shown may be out of date")
