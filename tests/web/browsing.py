"""The real service, and a real browser that looks at it."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Error, Page, Playwright, sync_playwright

from grader.app import create_app
from grader.settings import Settings
from servers import serving


@contextmanager
def service(settings: Settings) -> Iterator[str]:
    """The app with its worker and jail on the lesson's own content; yields its origin."""
    app = create_app(settings)
    with serving(app) as origin:
        yield origin
    app.state.context.database.close()


def settings_in(folder: Path, workers: int = 1) -> Settings:
    """Settings with a database of their own."""
    return Settings(data=folder, workers=workers)


@dataclass
class Chromium:
    """Debian's Chromium, without a window. Where it has died it is launched again, so that one test fails and no more.

    Raises AssertionError where it is missing.
    """

    playwright: Playwright
    options: tuple[str, ...]

    def __post_init__(self) -> None:
        self.browser = self.launch()

    def launch(self) -> Browser:
        path = shutil.which("chromium")
        assert path, "chromium is missing: `make test` installs it"
        args = ["--no-sandbox", "--disable-gpu", *self.options]
        return self.playwright.chromium.launch(executable_path=path, args=args)

    def new_context(self, **options: Any) -> BrowserContext:
        """Somebody's browser, with cookies of its own."""
        try:
            return self.browser.new_context(**options)
        except Error:
            if self.browser.is_connected():
                raise
        self.browser = self.launch()
        return self.browser.new_context(**options)


@contextmanager
def chromium(*more: str) -> Iterator[Chromium]:
    """A browser; `more` are further options."""
    with sync_playwright() as playwright:
        found = Chromium(playwright, more)
        try:
            yield found
        finally:
            found.browser.close()


def findings(page: Page) -> list[tuple[str, list[str]]]:
    """What axe-core finds, and what it cannot decide, but for contrast: test_style.py computes that of every colour.

    It cannot decide the contrast of text in a plot, which stands on the plot's own card, and of signs such as the arrow
    at a sorted column, which is hidden from readers and has the ink of its heading.
    """
    found = Axe().run(page, options={"rules": {"region": {"enabled": True}}}).response
    undecided = [one for one in found["incomplete"] if one["id"] != "color-contrast"]
    return [(one["id"], [node["html"][:200] for node in one["nodes"]]) for one in [*found["violations"], *undecided]]
