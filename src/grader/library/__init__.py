"""Loads and checks a content folder: quizzes/, models/ and starters. A folder with any fault is refused as a whole,
with all faults at once."""

from grader.library.loading import load, load_files
from grader.library.snapshot import Library

__all__ = ["Library", "load", "load_files"]
