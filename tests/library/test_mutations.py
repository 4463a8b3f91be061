"""A drawn part of the mutations of all content; `make fuzz-content` tries every one."""

import random

import pytest

from library.mutations import list_mutations, try_mutation

NUMBERS = ("negate", "reverse", "huge", "tiny", "drop", "many")


@pytest.mark.slow
def test_every_mutation_is_a_fault_with_its_place_or_is_checked_to_the_end() -> None:
    mutations = list(list_mutations())
    of_numbers = [one for one in mutations if one.name in NUMBERS]
    drawn = [*random.Random(1).sample(of_numbers, 120), *random.Random(2).sample(mutations, 80)]
    wrong = {str(one): why for one in drawn if (why := try_mutation(one)) is not None}
    assert wrong == {}
