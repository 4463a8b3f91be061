"""The browser of the tests: one that hangs or crashes fails one test, not all that follow."""

import pytest
from playwright.sync_api import Error

from web.browsing import Chromium, bounded


def test_a_browser_that_has_died_is_launched_again(browser: Chromium) -> None:
    browser.new_context().new_page()
    browser.kill()
    with browser.new_context() as context:
        assert context.new_page().evaluate("1 + 1") == 2


def test_a_page_that_never_answers_is_ended_with_words(browser: Chromium) -> None:
    page = browser.new_context().new_page()
    with pytest.raises(AssertionError, match="hung: it was killed after 1 s"), bounded(1), pytest.raises(Error):
        page.evaluate("() => { for (;;); }")
