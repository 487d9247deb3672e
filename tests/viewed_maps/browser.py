"""A page of the viewer in Chromium, and everything it complained of."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, ConsoleMessage, Page, expect, sync_playwright

from trigpoint_landmarks.http.viewer_files import BUILT

# WebGL without a graphics card, and nothing of the browser's own on the network.
FLAGS = (
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)
SOON_MS = 60_000.0  # what takes a second here takes many beside other jobs
AXE = BUILT.parent / "node_modules" / "axe-core" / "axe.min.js"
VIOLATIONS = """async () => {
    const told = await axe.run(document, {runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]});
    return told.violations.map((one) => `${one.id}: ${one.nodes.map((node) => node.target.join(" ")).join(", ")}`);
}"""


def missing() -> str:
    """What is not here of what the viewer is looked at with; empty: nothing."""
    if not (BUILT / "index.html").exists():
        return "the viewer was not built: `make viewer`"
    return "" if shutil.which("chromium") else "chromium is not installed"


@dataclass
class Viewed:
    """The viewer on a page; `complaints` are errors and warnings of its console, and uncaught exceptions."""

    page: Page
    complaints: list[str] = field(default_factory=list)

    def told(self, message: ConsoleMessage) -> None:
        """Keeps what the console was told."""
        if message.type in ("error", "warning"):
            self.complaints.append(f"{message.type}: {message.text}")

    def open(self, url: str, *, token: str = "") -> float:
        """The viewer of a service opened, and how long its first picture took, in ms of the page's own clock."""
        if token:
            self.page.add_init_script(f"sessionStorage.setItem('trigpoint-token', {token!r})")
        self.page.goto(f"{url}/viewer/")
        self.page.locator(".canvas[data-drawn]").wait_for(timeout=SOON_MS)
        return float(self.page.evaluate("performance.getEntriesByName('first-picture')[0].startTime"))

    def tab(self, name: str) -> None:
        """A tab of the panel brought up."""
        self.page.get_by_role("tab", name=name, exact=True).click()

    def says(self, text: str, *, within_ms: float = SOON_MS) -> None:
        """Returns once the text is to be seen; fails where it does not come."""
        self.page.get_by_text(text).first.wait_for(timeout=within_ms)

    def violations(self) -> list[str]:
        """What axe finds against the accessibility guidelines, WCAG 2.2 AA."""
        self.page.evaluate(AXE.read_text(encoding="utf-8"))
        found: list[str] = self.page.evaluate(VIOLATIONS)
        return found

    def pixels(self) -> bytes:
        """The map as it is on the screen, as a PNG."""
        return self.page.locator(".canvas canvas").first.screenshot()


@contextmanager
def chromium() -> Iterator[Browser]:
    """The browser, which has shown a page already: what it begins with once is not any page's time."""
    expect.set_options(timeout=SOON_MS)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        try:
            page = browser.new_page()
            page.set_content("<canvas></canvas>")
            page.evaluate("document.querySelector('canvas').getContext('webgl2').clear(16384)")
            page.screenshot()
            page.close()
            yield browser
        finally:
            browser.close()


@contextmanager
def viewed(browser: Browser, *, width: int = 1280, height: int = 800, **more: Any) -> Iterator[Viewed]:
    """An empty page of a size; `more` goes to the browser's context, as color_scheme="dark"."""
    context = browser.new_context(viewport={"width": width, "height": height}, **more)
    found = Viewed(context.new_page())
    found.page.set_default_timeout(SOON_MS)
    found.page.on("console", found.told)
    found.page.on("pageerror", lambda error: found.complaints.append(f"uncaught: {error}"))
    try:
        yield found
    finally:
        context.close()


def screenshot(shown: Viewed, path: Path) -> None:
    """The page as a picture."""
    shown.page.screenshot(path=path)
