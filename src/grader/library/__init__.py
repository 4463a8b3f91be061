"""Loads and checks a content folder: quizzes/, models/ and starters."""

from grader.library.loading import load
from grader.library.snapshot import Library

__all__ = ["Library", "load"]
