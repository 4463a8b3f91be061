"""Applies the ordered rules by which a kind names mistakes: the first rule that has a sentence wins."""

from collections.abc import Callable, Iterable
from typing import TypeVar

Evidence = TypeVar("Evidence")


def find_sentence(rules: Iterable[Callable[[Evidence], str | None]], evidence: Evidence) -> str | None:
    """Returns the sentence of the first rule that has one for the evidence; None if no rule applies."""
    return next((sentence for rule in rules if (sentence := rule(evidence)) is not None), None)
