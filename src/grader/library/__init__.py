"""Loads and checks a content folder: quizzes/, lessons/, models/ and starters. A folder with any fault is refused as a
whole, with all faults at once."""

from grader.library.checking.passed import NOTHING_PASSED, PassedChecks
from grader.library.checking.schema import list_policy_faults
from grader.library.loading import load, load_files
from grader.library.snapshot import Library

__all__ = ["NOTHING_PASSED", "Library", "PassedChecks", "list_policy_faults", "load", "load_files"]
