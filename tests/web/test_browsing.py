"""The browser of the tests: one that hangs or crashes fails one test, not all that follow."""

from web.browsing import Chromium


def test_a_browser_that_has_died_is_launched_again(browser: Chromium) -> None:
    browser.new_context().new_page()
    browser.kill()
    with browser.new_context() as context:
        assert context.new_page().evaluate("1 + 1") == 2
