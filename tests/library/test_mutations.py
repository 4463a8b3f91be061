"""A drawn part of the mutations of all content; `make fuzz-content` tries every one."""

import random

import pytest

from library.mutations import Mutation, list_mutations, try_mutation

NUMBERS = ("negate", "reverse", "huge", "tiny", "drop", "many")


@pytest.fixture(scope="module")
def mutations() -> list[Mutation]:
    return list(list_mutations())


@pytest.mark.slow
def test_every_mutation_is_a_fault_with_its_place_or_is_checked_to_the_end(mutations: list[Mutation]) -> None:
    of_numbers = [mutation for mutation in mutations if mutation.name in NUMBERS]
    drawn = [*random.Random(1).sample(of_numbers, 60), *random.Random(2).sample(mutations, 40)]
    wrong = {str(one): why for one in drawn if (why := try_mutation(one)) is not None}
    assert wrong == {}


FOUND = (
    ("questions.2.options", "many"),
    ("questions.2.verify.set.model.body_mass[1]", "replace"),
)
"""Mutations that once took more than their time, or ended in an error of MuJoCo."""


@pytest.mark.slow
@pytest.mark.parametrize(("key", "name"), FOUND)
def test_a_mutation_that_once_got_through_is_told(mutations: list[Mutation], key: str, name: str) -> None:
    matching = [mutation for mutation in mutations if mutation.name == name and ".".join(map(str, mutation.way)) == key]
    assert matching
    assert [why for one in matching if (why := try_mutation(one)) is not None] == []
