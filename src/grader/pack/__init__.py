"""Packs an exercise for another grader: Gradescope's autograder folder. The package holds one question with its models,
and the grader as a wheel."""

from grader.pack.gradescope import Packed, pack_gradescope

__all__ = ["Packed", "pack_gradescope"]
