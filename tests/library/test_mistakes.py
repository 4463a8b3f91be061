"""Realistic mistakes of authors are told with file and key; `python -m library.mistakes --draw 300` draws more."""

import pytest

from library.mistakes import draw_mistakes, judge_mistake


@pytest.mark.slow
def test_nearly_all_mistakes_are_told_and_none_of_a_key_is_silent() -> None:
    drawn = draw_mistakes(30, seed=5)
    silent = {str(one): why for one in drawn if (why := judge_mistake(one)) is not None}
    assert len(silent) <= 0.05 * len(drawn), silent
    assert not [name for name in silent if "answer" in name or "option" in name], silent
    assert not [why for why in silent.values() if "Traceback" in why]
