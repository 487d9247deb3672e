"""An anchor labelled in the viewer and taken back, as people do it: by mouse, by keyboard, and waiting for the map."""

import re
import time

from playwright.sync_api import expect

from viewed_maps.browser import Viewed

SOLVED_MS = 300_000.0  # for a whole solve beside everything else a machine does


def beside_a_suggestion(shown: Viewed) -> None:
    """The map gone to the next landmark whose label would help most."""
    with shown.page.expect_response("**/anchor-suggestions**"):
        shown.tab("Next")
    shown.page.get_by_role("button", name="Next", exact=True).press("Enter")
    expect(shown.page.locator(".ranked [aria-current]")).to_be_visible()


def placed_by_mouse(shown: Viewed) -> str:
    """A label set by a click into the middle of the map, where a landmark is; its name."""
    shown.tab("Label")
    box = shown.page.locator(".canvas").bounding_box()
    assert box is not None
    shown.page.mouse.click(box["x"] + box["width"] / 2 + 2, box["y"] + box["height"] / 2)
    return _tied(shown)


def placed_by_keyboard(shown: Viewed) -> str:
    """A label set at the suggestion that is current and moved by a decimetre, without a mouse; its name."""
    shown.page.get_by_role("button", name="Label an anchor here").press("Enter")
    marker = shown.page.get_by_role("button", name="Label position")
    expect(marker).to_be_focused()
    shown.page.keyboard.press("ArrowRight")
    return _tied(shown)


def _tied(shown: Viewed) -> str:
    expect(shown.page.locator(".verdict")).to_contain_text("Will be tied to")
    expect(shown.page.locator(".verdict")).to_have_attribute("data-tied", "true")
    return shown.page.get_by_label("Name", exact=True).input_value()


def submitted(shown: Viewed, name: str) -> float:
    """The label submitted by the Enter key; seconds until the map that is tied to it was seen."""
    began_s = time.monotonic()
    shown.page.get_by_role("button", name="Submit label").press("Enter")
    shown.says(f"{name} is in the log; waiting for the next map version")
    shown.says(f"{name} is tied to", within_ms=SOLVED_MS)
    return time.monotonic() - began_s


def retracted(shown: Viewed, name: str) -> float:
    """The anchor taken back; seconds until the map without it was seen."""
    shown.tab("List")
    shown.page.get_by_label("Show", exact=True).select_option("anchor")
    shown.page.get_by_label("Find").fill(name)
    shown.page.get_by_role("button", name=name).first.press("Enter")
    shown.page.get_by_role("button", name="Retract…").press("Enter")
    shown.page.get_by_label("Why (kept in the log)").fill("a trial")
    began_s = time.monotonic()
    shown.page.get_by_role("button", name=f"Retract {name}").press("Enter")
    shown.tab("Label")
    shown.says(f"{name} is retracted.", within_ms=SOLVED_MS)
    return time.monotonic() - began_s


def version_shown(shown: Viewed) -> int:
    """The map version the page says it shows."""
    found = re.search(r"Version (\d+)", shown.page.get_by_role("region", name="Map versions").inner_text())
    assert found is not None
    return int(found[1])
