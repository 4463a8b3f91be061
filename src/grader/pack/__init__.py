"""Packs an exercise for another grader: Gradescope's autograder folder."""

from grader.pack.gradescope import Packed, pack_gradescope

__all__ = ["Packed", "pack_gradescope"]
