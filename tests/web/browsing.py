"""The real service, and a real browser that looks at it."""

import os
import secrets
import shutil
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar
from weakref import WeakSet

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Error, Page, Playwright, sync_playwright

from grader.service.app import create_app
from grader.settings import Settings
from support.servers import serving

SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
"""WebGL without a GPU."""


@contextmanager
def service(settings: Settings) -> Iterator[str]:
    """The app with its worker and jail on the lesson's own content; yields its origin."""
    app = create_app(settings)
    with serving(app) as origin:
        yield origin
    app.state.services.database.close()


def settings_in(folder: Path, workers: int = 1) -> Settings:
    """Settings with a database of their own."""
    return Settings(data=folder, workers=workers)


TEST_S = 180.0
"""A browser that hangs is killed after it; the slowest test takes 40 s where the machine is busy."""


@dataclass(eq=False)
class Chromium:
    """Debian's Chromium, without a window. When it has died it is launched again, so that no other test fails.

    The shell without a user interface renders the same for a quarter of the CPU time.
    """

    playwright: Playwright
    options: tuple[str, ...]
    browser: Browser = field(init=False)
    mark: str = field(default_factory=lambda: f"--of-tests={secrets.token_hex(8)}")
    """Chromium ignores switches that it does not know; by this one its processes are found."""
    living: ClassVar[WeakSet["Chromium"]] = WeakSet()
    """All browsers of this process."""

    def __post_init__(self) -> None:
        self.living.add(self)
        self.launch()

    def launch(self) -> None:
        """Starts it. Raises AssertionError where it is missing."""
        path = shutil.which("chromium-headless-shell")
        assert path, "chromium-headless-shell is missing: `make test` installs it"
        args = ["--no-sandbox", "--disable-gpu", self.mark, *self.options]
        self.browser = self.playwright.chromium.launch(executable_path=path, args=args)

    def kill(self) -> None:
        """Ends it, from any thread: whatever waits for it fails."""
        for folder in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                if self.mark.encode() in (folder / "cmdline").read_bytes().split(b"\0"):
                    os.kill(int(folder.name), signal.SIGKILL)

    def new_context(self, **options: Any) -> BrowserContext:
        """Somebody's browser, with cookies of its own."""
        try:
            return self.browser.new_context(**options)
        except Error:
            if self.browser.is_connected():
                raise
        self.launch()
        return self.browser.new_context(**options)


@contextmanager
def bounded(seconds: float = TEST_S) -> Iterator[None]:
    """Ends a test that hangs, with words: some calls of playwright have no time limit of their own."""
    late = threading.Event()

    def end() -> None:
        late.set()
        for browser in list(Chromium.living):
            browser.kill()

    timer = threading.Timer(seconds, end)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
    assert not late.is_set(), f"the browser hung: it was killed after {seconds:g} s"


@contextmanager
def chromium(*more: str) -> Iterator[Chromium]:
    """A browser; `more` are further options."""
    with sync_playwright() as playwright:
        browser = Chromium(playwright, more)
        try:
            yield browser
        finally:
            browser.browser.close()


LYING_ON_OTHERS = """picture => {
  const boxes = [...picture.querySelectorAll('text, circle')].map(one => [one, one.getBoundingClientRect()]);
  const frame = picture.closest('figure').getBoundingClientRect();
  const on = (one, other) => one.left < other.right - 1 && other.left < one.right - 1
    && one.top < other.bottom - 2 && other.top < one.bottom - 2;
  const texts = boxes.filter(([one]) => one.tagName === 'text');
  return texts.filter(([one, box]) => box.left < frame.left || box.right > frame.right
    || boxes.some(([other, its]) => other !== one && on(box, its))).map(([one]) => one.textContent);
}"""
"""The texts of a picture that leave its figure, or lie on another text or on a dot."""


def findings(page: Page, *, contrast: bool = True) -> list[tuple[str, list[str]]]:
    """What axe-core finds, and what it cannot decide, but for contrast: test_style.py computes that of every colour.
    To look for contrast takes three quarters of the time, and need not be repeated at another width.

    It cannot decide the contrast of text in a plot, which stands on the plot's own card, and of signs such as the arrow
    at a sorted column, which is hidden from readers and has the ink of its heading.
    """
    wanted = ["violations", "incomplete"]  # of the passes, which are most, axe then describes one element a rule
    if not page.evaluate("'axe' in window"):  # half a megabyte of script, which stays until the page is left
        page.evaluate(Axe().axe_script)
    rules = {"region": {"enabled": True}, "color-contrast": {"enabled": contrast}}
    options = {"rules": rules, "resultTypes": wanted}
    report = page.evaluate("options => axe.run(options)", options)
    undecided = [one for one in report["incomplete"] if one["id"] != "color-contrast"]
    return [(one["id"], [node["html"][:200] for node in one["nodes"]]) for one in [*report["violations"], *undecided]]
