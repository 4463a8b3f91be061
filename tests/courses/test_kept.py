"""Parts of documents: what is kept is what would be made now, and nothing is made twice in one state."""

from collections.abc import Set

from hypothesis import given
from hypothesis import strategies as st

from grader.courses.kept import Kept, Parts

STATES = st.dictionaries(st.sampled_from("abc"), st.integers(0, 2))


@given(st.lists(st.tuples(st.sampled_from(["one", "two"]), STATES), max_size=12))
def test_only_parts_in_a_new_state_are_made(asked: list[tuple[str, dict[str, int]]]) -> None:
    kept: Parts[str, str, tuple[str, int]] = Parts(2)
    before: dict[str, dict[str, int]] = {"one": {}, "two": {}}
    for whole, states in asked:
        made: set[str] = set()

        def make(keys: Set[str], states: dict[str, int] = states, made: set[str] = made) -> dict[str, tuple[str, int]]:
            made |= keys
            return {key: (key, states[key]) for key in keys}

        assert list(kept.get(whole, states, make).items()) == [(key, (key, one)) for key, one in states.items()]
        assert made == {key for key, one in states.items() if before[whole].get(key) != one}
        before[whole] = states


def test_the_documents_used_last_are_kept() -> None:
    kept: Parts[str, str, int] = Parts(2)
    made: list[str] = []

    def get(whole: str) -> None:
        def make(keys: Set[str]) -> dict[str, int]:
            made.append(whole)
            return dict.fromkeys(keys, 1)

        kept.get(whole, {"part": 1}, make)

    for whole in ("one", "two", "one", "three", "one", "two"):
        get(whole)
    assert made == ["one", "two", "three", "two"]


def test_what_is_not_made_is_left_out_and_asked_for_again() -> None:
    kept: Parts[str, str, int] = Parts(1)
    assert kept.get("whole", {"a": 1, "b": 1}, lambda _: {"b": 2}) == {"b": 2}
    assert kept.get("whole", {"a": 1, "b": 1}, lambda keys: dict.fromkeys(keys, 3)) == {"a": 3, "b": 2}


def test_the_values_used_last_are_kept() -> None:
    kept: Kept[str, int] = Kept(2)
    made: list[str] = []

    def get(key: str) -> int:
        def make() -> int:
            made.append(key)
            return len(made)

        return kept.get(key, make)

    assert [get(key) for key in ("one", "two", "one", "three", "one", "two")] == [1, 2, 1, 3, 1, 4]
    assert made == ["one", "two", "three", "two"]
