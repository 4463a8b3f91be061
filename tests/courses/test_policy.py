"""What may be answered when, with which multiplier, and which points count."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import reduce

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from grader.courses.answering.intake import add_attempt
from grader.courses.rules.policy import (
    NO_EXTENSION,
    Attempt,
    CountedPoints,
    Decision,
    Visibility,
    count_points,
    decide,
    has_opened,
    late_multiplier,
)
from grader.domain.policy import Extension, Late, Policy, Progress
from grader.domain.verdict import Status
from grader.questions.kinds.number import NumberQuestion
from grader.questions.kinds.text import TextQuestion

DUE = datetime(2026, 3, 10, 18, tzinfo=UTC)
DAY = timedelta(days=1)
LATE = Late(per_day=0.8, floor=0.3, until=DUE + 5 * DAY)
QUESTION = TextQuestion(kind="open", id="q1", q="Why?", points=10)
FREE = [Status.INVALID_ANSWER, Status.GRADER_FAULT]
PAID = [status for status in Status if status.uses_attempt]


def attempt(number: int, points: float = 0.0, status: Status | None = Status.PARTIAL, at: datetime = DUE) -> Attempt:
    uses_attempt = status is None or status.uses_attempt
    return Attempt(f"s{number}", number, at, status, points, uses_attempt)


def ask(
    policy: Policy,
    attempts: Sequence[Attempt] = (),
    now: datetime = DUE,
    *,
    role: str = "student",
    extension: Extension | None = None,
    published_at: datetime | None = None,
    attempts_allowed: int | None = None,
) -> Decision:
    question = QUESTION.model_copy(update={"attempts": attempts_allowed})
    return decide(policy, extension, question, progress_of(attempts), now, role=role, published_at=published_at)


def progress_of(attempts: Sequence[Attempt]) -> Progress:
    return reduce(add_attempt, (attempt.status for attempt in attempts), Progress())


moments = st.integers(-30 * 24 * 60, 30 * 24 * 60).map(lambda minutes: DUE + timedelta(minutes=minutes))
lates = st.builds(
    Late,
    per_day=st.floats(0, 1),
    floor=st.floats(0, 1),
    until=st.integers(1, 20 * 24).map(lambda hours: DUE + timedelta(hours=hours)),
)
COUNTS, SOLUTIONS = ["best", "latest", "average"], ["with_feedback", "when_right_or_spent", "after_due", "never"]


@st.composite
def policies(draw: st.DrawFn) -> Policy:
    due = draw(st.none() | st.just(DUE))
    after_due = [] if due is None else ["after_due"]
    return Policy.model_validate(
        {
            "attempts": draw(st.none() | st.integers(1, 5)),
            "opens": draw(st.none() | st.integers(1, 60).map(lambda days: DUE - days * DAY)),
            "due": due,
            "late": draw(st.none() | lates) if due else None,
            "counts": draw(st.sampled_from(COUNTS)),
            "feedback": draw(st.sampled_from(["immediate", "after_publish", *after_due])),
            "solutions": draw(st.sampled_from([solution for solution in SOLUTIONS if due or solution != "after_due"])),
        }
    )


extensions = st.builds(Extension, due=st.none() | moments, until=st.none() | moments, attempts=st.integers(0, 3))
attempt_lists = st.lists(
    st.tuples(st.none() | st.sampled_from(list(Status)), st.floats(0, 10), moments), max_size=6
).map(lambda many: [attempt(n, points, status, at) for n, (status, points, at) in enumerate(many, 1)])


def test_without_a_policy_one_may_answer_as_often_as_one_likes() -> None:
    decision = ask(Policy(), [attempt(n) for n in range(1, 100)])
    assert decision.may_answer
    assert decision.attempts_left is None
    assert decision.multiplier == 1
    assert decision.withheld is None
    assert decision.shown is Visibility.FEEDBACK


def test_answers_are_taken_from_opens_to_due_both_included() -> None:
    policy = Policy(opens=DUE - DAY, due=DUE)
    second = timedelta(seconds=1)
    asked = [ask(policy, now=now) for now in (DUE - DAY - second, DUE - DAY, DUE, DUE + second)]
    assert [decision.may_answer for decision in asked] == [False, True, True, False]
    assert asked[0].why_not == "This quiz opens on 9 Mar 2026, 18:00 UTC."
    assert asked[3].why_not == "This quiz closed on 10 Mar 2026, 18:00 UTC."
    assert asked[3].multiplier is None


def test_before_it_opens_only_a_learner_may_not_read_it() -> None:
    policy = Policy(opens=DUE)
    assert not has_opened(policy, DUE - DAY, "student")
    assert has_opened(policy, DUE, "student")
    assert has_opened(policy, DUE - DAY, "instructor")
    assert has_opened(Policy(), DUE, "student")


def test_every_day_started_costs_down_to_the_floor() -> None:
    policy = Policy(due=DUE, late=LATE)
    hours = [0, 1, 24, 25, 72, 120]
    multipliers = [ask(policy, now=DUE + timedelta(hours=h)).multiplier for h in hours]
    assert multipliers == pytest.approx([1, 0.8, 0.8, 0.64, 0.512, 0.32768])
    assert late_multiplier(policy, NO_EXTENSION, DUE + 30 * DAY) == 0.3
    assert not ask(policy, now=DUE + 5 * DAY + timedelta(seconds=1)).may_answer


def test_the_questions_own_attempts_are_stronger_and_an_extension_adds() -> None:
    policy, used = Policy(attempts=3), [attempt(1), attempt(2)]
    assert ask(policy, used).attempts_left == 1
    spent = ask(policy, used, attempts_allowed=2)
    assert spent.why_not == "Both attempts at this question are used up."
    assert spent.attempts_left == 0
    assert ask(policy, used, attempts_allowed=2, extension=Extension(attempts=1)).attempts_left == 1


def test_the_dates_of_an_extension_count_for_closing_and_for_lateness() -> None:
    policy, extension = Policy(due=DUE, late=LATE), Extension(due=DUE + 2 * DAY, until=DUE + 9 * DAY)
    assert ask(policy, now=DUE + 2 * DAY, extension=extension).multiplier == 1
    assert ask(policy, now=DUE + 3 * DAY, extension=extension).multiplier == 0.8
    assert ask(policy, now=DUE + 9 * DAY, extension=extension).may_answer
    assert not ask(policy, now=DUE + 9 * DAY + timedelta(seconds=1), extension=extension).may_answer


def test_an_extended_due_date_is_kept_where_it_is_later_than_any_until() -> None:
    extension = Extension(due=DUE + 9 * DAY, until=DUE + DAY)
    assert ask(Policy(due=DUE, late=LATE), now=DUE + 9 * DAY, extension=extension).multiplier == 1


@pytest.mark.parametrize("role", ["instructor", "service"])
def test_instructors_and_services_see_all_and_may_try_at_any_time(role: str) -> None:
    policy = Policy(attempts=1, opens=DUE, due=DUE + DAY, feedback="after_due", solutions="never")
    for now in (DUE - DAY, DUE + 9 * DAY):
        decision = ask(policy, [attempt(1)], now, role=role)
        assert decision.may_answer
        assert decision.shown is Visibility.SOLUTION


def test_an_unknown_role_is_a_learner() -> None:
    assert ask(Policy(opens=DUE + DAY), role="guest").why_not


def test_feedback_after_due_waits_for_the_last_moment_of_late_answers() -> None:
    policy = Policy(due=DUE, late=LATE, feedback="after_due")
    waiting = ask(policy, [attempt(1, 10, Status.CORRECT)], DUE + 5 * DAY)
    assert waiting.shown is Visibility.RECEIPT
    assert waiting.withheld == "Your answer is recorded; you see how it was graded after 15 Mar 2026, 18:00 UTC."
    assert ask(policy, [attempt(1)], DUE + 6 * DAY).shown is Visibility.SOLUTION
    assert ask(policy, [attempt(1)], DUE + 6 * DAY, extension=Extension(due=DUE + 7 * DAY)).shown is Visibility.RECEIPT


def test_feedback_after_publish() -> None:
    policy = Policy(feedback="after_publish", solutions="with_feedback")
    assert ask(policy).withheld == "Your answer is recorded; you see how it was graded once the results are published."
    assert ask(policy, published_at=DUE + DAY).shown is Visibility.RECEIPT
    assert ask(policy, published_at=DUE).shown is Visibility.SOLUTION


@pytest.mark.parametrize(
    ("solutions", "wrong", "right", "spent", "closed"),
    [
        ("with_feedback", True, True, True, True),
        ("when_right_or_spent", False, True, True, True),
        ("after_due", False, False, False, True),
        ("never", False, False, False, False),
    ],
)
def test_when_the_solution_is_shown(solutions: str, wrong: bool, right: bool, spent: bool, closed: bool) -> None:
    policy = Policy.model_validate({"due": DUE, "attempts": 2, "solutions": solutions})
    one, best, both = [attempt(1)], [attempt(1, 10, Status.CORRECT)], [attempt(1), attempt(2)]
    asked = [ask(policy, one), ask(policy, best), ask(policy, both), ask(policy, one, DUE + DAY)]
    assert [decision.shown is Visibility.SOLUTION for decision in asked] == [wrong, right, spent, closed]


def test_the_last_attempt_is_spent_only_once_it_has_a_verdict() -> None:
    policy = Policy(attempts=1)
    waiting = ask(policy, [attempt(1, status=None)])
    assert not waiting.may_answer
    assert waiting.shown is Visibility.FEEDBACK  # a fault of the grader would give the attempt back
    assert ask(policy, [attempt(1)]).shown is Visibility.SOLUTION
    assert ask(policy, [attempt(1, status=Status.GRADER_FAULT)]).attempts_left == 1


@given(policies(), extensions, attempt_lists, moments, st.none() | moments)
def test_whether_and_why_agree_and_no_solution_is_shown_to_one_without_feedback(
    policy: Policy, extension: Extension, attempts: list[Attempt], now: datetime, published_at: datetime | None
) -> None:
    decision = ask(policy, attempts, now, extension=extension, published_at=published_at)
    assert decision.may_answer == (decision.multiplier is not None)
    assert (decision.withheld is None) == (decision.shown >= Visibility.FEEDBACK)
    if policy.feedback == "after_due" and decision.shown > Visibility.RECEIPT:
        assert not decision.may_answer
    if policy.solutions == "after_due" and decision.shown is Visibility.SOLUTION:
        assert not decision.may_answer


@given(policies(), extensions, attempt_lists, moments)
def test_before_the_feedback_a_decision_depends_on_no_verdict(
    policy: Policy, extension: Extension, attempts: list[Attempt], now: datetime
) -> None:
    assume(policy.feedback != "immediate")
    decision = ask(policy, attempts, now, extension=extension)
    assume(decision.shown is Visibility.RECEIPT)
    others = [
        replace(one, points=10 - one.points, status=Status.CORRECT) if one.status in PAID else one for one in attempts
    ]
    assert ask(policy, others, now, extension=extension) == decision


@given(policies(), extensions, moments, moments)
def test_a_late_multiplier_is_between_floor_and_1_and_never_rises(
    policy: Policy, extension: Extension, one: datetime, other: datetime
) -> None:
    early, late = sorted((one, other))
    floor = policy.late.floor if policy.late else 1
    assert floor <= late_multiplier(policy, extension, late) <= late_multiplier(policy, extension, early) <= 1
    if policy.due is None or early <= policy.due:
        assert late_multiplier(policy, extension, early) == 1


@given(policies(), extensions, attempt_lists, moments)
def test_an_extension_makes_nothing_worse(
    policy: Policy, extension: Extension, attempts: list[Attempt], now: datetime
) -> None:
    plain, extended = ask(policy, attempts, now), ask(policy, attempts, now, extension=extension)
    assert extended.may_answer >= plain.may_answer
    if plain.attempts_left is not None:
        assert extended.attempts_left is not None
        assert extended.attempts_left >= plain.attempts_left
    if plain.multiplier is not None:
        assert extended.multiplier is not None
        assert extended.multiplier >= plain.multiplier
    assert count_points(attempts, policy, extension).points >= count_points(attempts, policy, None).points


@given(policies(), extensions, attempt_lists, moments, st.sampled_from(FREE), moments)
def test_a_later_fault_or_unreadable_answer_changes_nothing(
    policy: Policy, extension: Extension, attempts: list[Attempt], now: datetime, status: Status, at: datetime
) -> None:
    more = [*attempts, attempt(len(attempts) + 1, 0.0, status, at)]
    assert count_points(more, policy, extension) == count_points(attempts, policy, extension)
    assert ask(policy, more, now, extension=extension) == ask(policy, attempts, now, extension=extension)


@given(policies(), extensions, attempt_lists, st.sampled_from(PAID), st.floats(0, 10), moments)
def test_under_best_another_attempt_never_lowers_the_points(
    policy: Policy, extension: Extension, attempts: list[Attempt], status: Status, points: float, at: datetime
) -> None:
    best = policy.model_copy(update={"counts": "best"})
    more = [*attempts, attempt(len(attempts) + 1, points, status, at)]
    before, after = count_points(attempts, best, extension), count_points(more, best, extension)
    assert after.points >= before.points
    own = round(points * late_multiplier(best, extension, at), 9)
    assert after.points == max(before.points, own)


@given(policies(), extensions, attempt_lists)
def test_average_is_the_mean_of_the_attempts_that_used_one(
    policy: Policy, extension: Extension, attempts: list[Attempt]
) -> None:
    average = count_points(attempts, policy.model_copy(update={"counts": "average"}), extension)
    used = [one for one in attempts if one.status in PAID]
    used = [one for one in used if one.status is not Status.NEEDS_REVIEW] or used
    shares = [one.points * late_multiplier(policy, extension, one.at) for one in used]
    assert average.sources == tuple(used)
    assert average.points == pytest.approx(sum(shares) / len(shares) if shares else 0, abs=1e-9)


@given(policies(), extensions, attempt_lists)
def test_points_come_from_their_sources_to_9_digits(
    policy: Policy, extension: Extension, attempts: list[Attempt]
) -> None:
    counted = count_points(attempts, policy, extension)
    assert counted.points == round(counted.points, 9)
    assert 0 <= counted.points <= 10
    assert bool(counted.sources) == any(one.status in PAID for one in attempts)
    assert counted.numbers == tuple(one.number for one in counted.sources)
    if policy.counts != "average" and counted.sources:
        (source,) = counted.sources
        assert counted.points == round(source.points * late_multiplier(policy, extension, source.at), 9)


def test_best_latest_and_average() -> None:
    attempts = [attempt(1, 2), attempt(2, 9), attempt(3, 9), attempt(4, 1)]
    counted = {name: count_points(attempts, Policy.model_validate({"counts": name}), None) for name in COUNTS}
    numbers = {name: (one.points, one.numbers) for name, one in counted.items()}
    assert numbers == {"best": (9, (2,)), "latest": (1, (4,)), "average": (5.25, (1, 2, 3, 4))}


def test_what_nobody_has_marked_does_not_lower_an_average() -> None:
    attempts = [attempt(1, status=Status.NEEDS_REVIEW), attempt(2, 4)]
    counted = count_points(attempts, Policy(counts="average"), None)
    assert (counted.points, counted.numbers, counted.is_final) == (4, (2,), False)
    assert count_points(attempts[:1], Policy(counts="average"), None).numbers == (1,)


def test_points_are_final_once_nothing_waits() -> None:
    review = attempt(1, status=Status.NEEDS_REVIEW)
    assert count_points([], Policy(), None) == CountedPoints(0.0, (), True)
    assert not count_points([review], Policy(), None).is_final
    assert not count_points([attempt(1, 3), attempt(2, status=None)], Policy(), None).is_final
    assert count_points(
        [review, attempt(2, 3)], Policy(), None
    ).is_final  # only the newest attempt waits for a reviewer


@pytest.mark.parametrize(
    ("keys", "where", "why"),
    [
        ({"opens": DUE, "due": DUE}, "due", "must be later than opens"),
        ({"late": LATE}, "late", "needs a due date"),
        ({"due": DUE, "late": {"per_day": 0.5, "until": DUE}}, "late", "an until that is later"),
        ({"due": DUE, "late": {"per_day": 0.5}}, "until", "required"),
        ({"due": DUE, "late": {"per_day": 1.5, "until": DUE + DAY}}, "per_day", "less than or equal to 1"),
        ({"feedback": "after_due"}, "feedback", "after_due needs a due date"),
        ({"solutions": "after_due"}, "solutions", "after_due needs a due date"),
        ({"due": datetime(2026, 3, 1, 12)}, "due", "timezone"),
        ({"due": datetime.max.replace(tzinfo=UTC)}, "due", "less than"),
        ({"attempts": 0}, "attempts", "greater than or equal to 1"),
    ],
)
def test_policies_that_contradict_themselves_are_refused(keys: dict[str, object], where: str, why: str) -> None:
    with pytest.raises(ValidationError) as error:
        Policy.model_validate(keys)
    (detail,) = error.value.errors()
    assert detail["loc"][-1] == where
    assert why in detail["msg"]


@pytest.mark.parametrize(("written", "reveal"), [(None, "size"), ("direction", "direction"), ("value", "value")])
def test_the_author_chooses_what_the_feedback_reveals(written: str | None, reveal: str) -> None:
    asked = {"kind": "numeric", "id": "q1", "q": "How long?", "answer": 5.0, "reveal": written}
    question = NumberQuestion.model_validate(asked)
    assert decide(Policy(), None, question, Progress(used=1), DUE, role="student").reveal == reveal
