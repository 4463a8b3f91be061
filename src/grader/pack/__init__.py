"""Packs an exercise for others: Gradescope's autograder folder, which holds one question with its models and the grader
as a wheel; and the kit of a learner, which holds nothing hidden."""

from grader.pack.gradescope import PackedFile, pack_gradescope

__all__ = ["PackedFile", "pack_gradescope"]
