"""The content of this project, loaded once for all files of tests in a process."""

import os
from functools import cache
from pathlib import Path

from grader.library import Library, PassedChecks, load

ROOT = Path(__file__).parents[2]
PASSED = PassedChecks(Path(os.environ["GRADER_CACHE"]))
"""What has passed in this run of tests, which is not checked again."""


@cache
def load_content(quiz: str | None = None) -> Library:
    """Loads all content, or one quiz of it."""
    return load(ROOT, quiz, PASSED)
