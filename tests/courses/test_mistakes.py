"""The mistakes of a class by family, and the claims of a verdict on their axes."""

import math

import pytest

from grader.courses.rules.claims import Claim, ClaimAxis, list_bracket_axes, list_number_axes, merge_axes, read_claims
from grader.courses.rules.mistakes import find_cure, group_mistakes, name_family, name_mistake
from grader.questions.kinds.number import NumberQuestion

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
    assert name_family(BOUND).name == "You reported the bound 2*sqrt(I/kp)"
    assert find_cure(BOUND) == "Ignores the damper: simulate instead of computing it."
    assert find_cure("TypeError: x, in line 3 of your script.") == ""  # it quotes one learner's script
    assert find_cure("Just this.") == ""


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
    assert [(one.key, [m.learner for m in one.still], [m.learner for m in one.was]) for one in families] == [
        (bound.key, ["bob"], ["ann"]),
        (short.key, ["cem"], ["bob"]),
    ]
    assert families[0].still[0].submission == "b3"  # the last one that ended in it


def make_verdict(claim: object, *, said_none: bool = False, linear: object = 20.0) -> dict[str, object]:
    limits = [{"case": "a.Euler", "linear_ms": linear, "within_ms": 20.1, "spring_ms": 22.4}]
    claims = [{"case": "a.Euler", "claim_ms": claim, "said_none": said_none}]
    return {"findings": [{"id": "a.Euler", "title": "kp, Euler"}], "evidence": {"claims": claims, "limits": limits}}


def test_a_bracket_has_to_hold_the_limit() -> None:
    [axis] = list_bracket_axes(make_verdict([19.9, 20.2]))
    assert (axis.title, axis.unit, axis.right, axis.marks[0][1]) == ("kp, Euler", "ms", (20.0, 20.1), 22.4)
    assert axis.accepts(Claim(19.9, 20.2)) and axis.accepts(Claim(20.05, 20.3))
    assert not axis.accepts(Claim(22.1, 22.6)) and not axis.accepts(Claim(math.nan, math.nan))


def test_without_a_limit_none_is_right() -> None:
    [axis] = list_bracket_axes(make_verdict(None, said_none=True, linear=None))
    [claim] = read_claims(make_verdict(None, said_none=True, linear=None), [axis]).values()
    assert axis.right is None and claim.is_none and axis.accepts(claim)
    assert not axis.accepts(Claim(20, 21))


@pytest.mark.parametrize("claim", ["x", [1], [1, None], [math.inf, 2], {"a": 1}, None, [True, False]])
def test_evidence_that_cannot_be_read_is_left_out(claim: object) -> None:
    assert read_claims(make_verdict(claim), [ClaimAxis("a.Euler", "", "ms")]) == {}
    assert list_bracket_axes({"evidence": {"claims": "old", "limits": 3}}) == []
    assert list_bracket_axes({}) == []


def test_the_axis_of_a_number_has_its_tolerance() -> None:
    asked = NumberQuestion.model_validate(
        {"id": "q", "kind": "numeric", "q": "?", "answer": 5, "tol": 0.5, "unit": "ms"}
    )
    [axis] = list_number_axes(asked)
    assert axis.right == (4.5, 5.5) and not axis.is_limit
    assert read_claims({"evidence": {"value": 10}}, [axis]) == {axis.id: Claim(10, 10)}


def test_a_limit_that_one_verdict_knows_is_known() -> None:
    unknown, known = ClaimAxis("a", "", "ms"), ClaimAxis("a", "", "ms", (1, 2))
    assert merge_axes([[unknown], [known], [unknown]]) == [known]
