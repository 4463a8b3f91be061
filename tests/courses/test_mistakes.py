"""The mistakes of a class by family."""

import pytest

from grader.courses.rules.mistakes import find_cure, group_mistakes, name_family, name_mistake
from grader.questions.kinds.order import ROTATED

BOUND = "You reported the bound 2*sqrt(I/kp), which ignores the damper: simulate instead of computing it."


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("Your search ends at 5 ms: go on.", "Your search ends at 30 ms: go on to 50 ms."),
        ("TypeError: f() missing 1 argument, in line 3 of your script.", "kp = 2, Euler: TypeError: x, in line 9."),
        (
            "Rename largest_h to limit_of: the grader calls limit_of.",
            "Rename my_step to limit_of: the grader calls it.",
        ),
        ("TypeError: x", "Ended with an error: TypeError"),
    ],
)
def test_sentences_that_differ_in_a_number_or_a_name_are_one_mistake(one: str, other: str) -> None:
    assert name_family(one).key == name_family(other).key


def test_other_mistakes_are_other_families() -> None:
    assert (
        len({name_family(one).key for one in (BOUND, "TypeError: x", "ValueError: x", "Your runs are too short.")}) == 4
    )


def test_a_name_is_the_first_clause_and_the_cure_the_rest() -> None:
    two = f"Two things are wrong. First: {BOUND} Second: Your runs are too short."
    assert name_family(two).key == name_family(BOUND).key
    assert name_family(BOUND).name == "You reported the bound 2*sqrt(I/kp)"
    assert find_cure(BOUND) == "Simulate instead of computing it."
    assert find_cure("TypeError: x, in line 3 of your script.") == ""  # it quotes one learner's script
    assert find_cure("Just this.") == ""


@pytest.mark.parametrize(
    ("sentence", "name"),
    [
        ("energy: The damping is missing: subtract it.", "The damping is missing"),
        ("step: data.time is left as it was: write it.", "data.time is left as it was"),
        ("Gain K: your number is off by a power of ten: check the units.", "Your number is off by a power of ten"),
        ("Period and speed: each number is doubled.", "Each number is doubled"),
        ("from 1 rad: The state does not stay finite.", "The state does not stay finite"),
        ("kp = 2, Euler: TypeError: x, in line 9.", "Ended with an error: TypeError"),
        ("Your step is explicit: positions move first.", "Your step is explicit"),
        ("left alone for 2 s: model.body('lid').pos is not right.", "model.body('lid').pos is not right"),
    ],
)
def test_a_name_leaves_out_where_the_mistake_was_made(sentence: str, name: str) -> None:
    assert name_family(sentence).name == name
    assert find_cure(sentence) != sentence


@pytest.mark.parametrize(
    ("sentence", "cure"),
    [
        ("Energy is what Euler gives, which is not that of the experiment.", ""),
        ("This is Kutta's rule, which is of second order. MuJoCo does that.", "MuJoCo does that."),
        ("Use seconds, but milliseconds were asked for: convert it.", "Milliseconds were asked for: convert it."),
        ("The fourth stage is never evaluated: k3 is used twice.", "k3 is used twice."),
        ("The state is not restored: q and v alias data.qpos.", "q and v alias data.qpos."),
        ("There is no time: data.time has to be set.", "data.time has to be set."),
        ("It is slow: a contact acts.", "A contact acts."),
        ("MuJoCo cannot compile the model: XML parse error 8: ErrorID=8", ""),
        ("left alone: data.body('a').xpos moves otherwise. model.body('a').mass is larger. (2 more)", ""),
    ],
)
def test_a_cure_is_a_whole_sentence(sentence: str, cure: str) -> None:
    assert find_cure(sentence) == cure


def test_a_name_that_begins_with_praise_tells_what_is_wrong() -> None:
    name = "Your items follow each other rightly, but the order begins at the wrong one"
    assert name_family(ROTATED).name == name
    assert find_cure(ROTATED) == "Check which comes first."
    turns = "Your quaternions turn as they should, but their length is not 1"
    assert name_family(f"{turns}: divide the four numbers.").name == turns


def test_what_is_right_or_waits_is_no_mistake() -> None:
    assert name_mistake("correct", None) is None
    assert name_mistake("needs_review", None) is None
    unnamed = name_mistake("timed_out", None)
    assert unnamed is not None and (unnamed.name, unnamed.sentence) == ("Ran out of time", "")


def test_still_is_the_newest_verdict_and_was_an_earlier_one() -> None:
    bound, short = name_family(BOUND), name_family("Your runs are too short.")
    families = group_mistakes({
        "ann": [("a1", bound), ("a2", None)],
        "bob": [("b1", bound), ("b2", short), ("b3", bound)],
        "cem": [("c1", short)],
    })  # fmt: skip
    assert [
        (family.key, [m.learner for m in family.still], [m.learner for m in family.was]) for family in families
    ] == [
        (bound.key, ["bob"], ["ann"]),
        (short.key, ["cem"], ["bob"]),
    ]
    assert families[0].still[0].submission == "b3"  # the last one that ended in it
