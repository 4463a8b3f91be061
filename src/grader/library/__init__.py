"""The content folder, loaded whole and once: quizzes/, models/ and starters, proved before anything is served."""

from grader.library.library import Library
from grader.library.loading import load

__all__ = ["Library", "load"]
