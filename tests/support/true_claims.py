"""Holds every sentence on a mistake against the script that it is about, whenever a test judges a script."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest

from grader.exercises.explaining.claims import CLAIMS, Evidence, SentenceClaim, correct_sentence, find_untrue
from grader.exercises.running import diagnosing

HELD = {"sentences": 0}
"""How many sentences were held against their scripts."""


@contextmanager
def telling_the_truth() -> Iterator[None]:
    """Raises AssertionError where a rule makes a sentence that is not true, although it would not be shown."""

    def assert_true(sentence: str, evidence: Evidence, claims: Sequence[SentenceClaim] = CLAIMS) -> str | None:
        corrected = correct_sentence(sentence, evidence, claims)
        assert corrected is not None, f"{list(find_untrue(sentence, evidence, claims))} of: {sentence}"
        assert not list(find_untrue(corrected, evidence, claims))
        HELD["sentences"] += 1
        return corrected

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnosing, "correct_sentence", assert_true)
        yield
