"""The real service, and a real browser that looks at it."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

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


@contextmanager
def chromium(*more: str) -> Iterator[Browser]:
    """Debian's Chromium, without a window; `more` are further options."""
    path = shutil.which("chromium")
    assert path, "chromium is missing: `make test` installs it"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu", *more])
        try:
            yield browser
        finally:
            browser.close()
