"""Statistics against closed forms, numpy, scipy, and cohorts whose truth is known."""

import json
import math
import random
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import Any

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st

from grader.courses.rules import statistics
from grader.courses.rules.statistics import (
    QuestionStatistics,
    ResultRow,
    find_clusters,
    group_crash,
    mean_share,
    tally_answers,
)
from grader.domain.verdict import Status

shares = st.lists(st.integers(0, 3).map(lambda n: n / 3), min_size=1, max_size=40)


def row(learner: object, question: str, points: float, **more: object) -> ResultRow:
    status = Status.CORRECT if points == 1 else Status.INCORRECT
    return ResultRow(**{"learner": str(learner), "question": question, "points": points, "max_points": 1.0,
                  "first_status": status, **more})  # type: ignore[arg-type]  # fmt: skip


def statistics_of(
    rows: Sequence[ResultRow], tolerances: Mapping[str, Sequence[float]] | None = None
) -> tuple[QuestionStatistics, ...]:
    pieces = [rows[:5], rows[5:]]
    return statistics.compute_statistics(list(tally_answers(pieces, tolerances).values()))


@given(st.lists(st.booleans(), min_size=1, max_size=60))
def test_the_interval_of_right_and_wrong_is_wilsons(answers: list[bool]) -> None:
    share = mean_share([float(answer) for answer in answers])
    expected = scipy.stats.binomtest(sum(answers), len(answers)).proportion_ci(0.95, method="wilson")
    assert (share.low, share.high) == pytest.approx((expected.low, expected.high), abs=1e-12)
    assert share.value == pytest.approx(np.mean(answers))


@given(shares)
def test_an_interval_holds_its_mean_and_stays_between_0_and_1(given_shares: list[float]) -> None:
    share = mean_share(given_shares)
    assert 0 <= share.low <= share.value <= share.high <= 1
    assert share.low < share.high


@pytest.mark.parametrize("steps", [1, 2, 4, 20])
def test_the_interval_covers_the_true_mean_in_95_of_100_cohorts(steps: int) -> None:
    """25 shares in steps of 1/steps, true means all over [0, 1]; 4,000 cohorts: one sigma is 0.35 %."""
    chance = random.Random(steps)
    cohorts, covered = 4000, 0
    for _ in range(cohorts):
        truth = chance.random()
        share = mean_share([sum(chance.random() < truth for _ in range(steps)) / steps for _ in range(25)])
        covered += share.low <= truth <= share.high
    assert covered / cohorts > 0.94


def test_the_coverage_of_right_and_wrong_is_95_percent_over_all_true_means() -> None:
    """Without chance: the binomial probability of every count whose interval holds the true mean."""
    n, truths = 25, (np.arange(2000) + 0.5) / 2000
    coverage = np.zeros_like(truths)
    for right in range(n + 1):
        share = mean_share([1.0] * right + [0.0] * (n - right))
        held = (share.low <= truths) & (truths <= share.high)
        coverage += held * scipy.stats.binom.pmf(right, n, truths)
    assert coverage.mean() == pytest.approx(0.9527, abs=5e-4)


def test_no_shares_have_no_mean() -> None:
    with pytest.raises(ValueError, match="no shares"):
        mean_share([])


@given(st.integers(0, 2**32), st.integers(4, 30))
def test_discrimination_is_numpys_correlation_with_the_rest(seed: int, learners: int) -> None:
    table = np.random.default_rng(seed).integers(0, 4, (learners, 3)) / 3
    rows = [row(i, f"q{j}", float(table[i, j])) for i in range(learners) for j in range(3)]
    for j, question in enumerate(statistics_of(rows)):
        item, rest = table[:, j], table.sum(axis=1) - table[:, j]
        if np.ptp(item) == 0 or np.ptp(np.round(rest, 9)) == 0:
            assert question.discrimination is None
            continue
        expected = scipy.stats.pearsonr(item, rest)
        assert question.discrimination is not None
        assert question.discrimination.value == pytest.approx(expected.statistic, abs=1e-7)
        low, high = expected.confidence_interval(0.95)
        assert (question.discrimination.low, question.discrimination.high) == pytest.approx((low, high), abs=1e-6)
        assert question.discrimination.n == learners


def test_discrimination_is_the_point_biserial_correlation_of_right_and_wrong() -> None:
    right, rest = [0, 0, 1, 1, 1, 0], [0.1, 0.4, 0.5, 0.9, 0.3, 0.2]
    rows = [row(i, "q", one) for i, one in enumerate(right)] + [row(i, "rest", value) for i, value in enumerate(rest)]
    discrimination = statistics_of(rows)[0].discrimination
    assert discrimination is not None
    assert discrimination.value == pytest.approx(
        scipy.stats.pointbiserialr(np.array(right) == 1, rest).statistic, abs=1e-12
    )


def test_discrimination_is_null_where_it_is_undefined() -> None:
    alone = statistics_of([row(i, "q", i % 2) for i in range(9)])
    few = statistics_of([row(i, q, (i + len(q)) % 2) for i in range(3) for q in ("q", "qq")])
    same = statistics_of([row(i, q, 1 if q == "q" else i % 2) for i in range(9) for q in ("q", "qq")])
    assert [question.discrimination for question in (*alone, *few, *same)] == [None] * 5


def test_a_perfect_correlation_has_no_width() -> None:
    discrimination = statistics_of([row(i, q, i % 2) for i in range(6) for q in ("q", "r")])[0].discrimination
    assert discrimination is not None
    assert (discrimination.value, discrimination.low, discrimination.high) == pytest.approx((1, 1, 1))


def test_questions_that_a_learner_has_not_answered_do_not_count_against_them() -> None:
    rows = [row(i, q, i % 2) for i in range(8) for q in ("q", "r")]
    more = [*rows, row("late", "q", 1)]  # answered nothing else: has no rest
    question = statistics_of(more)[0]
    assert question.difficulty.n == 9
    assert question.discrimination is not None
    assert question.discrimination.n == 8


def test_a_simulated_cohort_shows_which_question_is_hard_and_which_tells_nothing() -> None:
    """500 learners of normal ability; right with probability logistic(slope * (ability - difficulty))."""
    chance = random.Random(7)
    questions = {"easy": (2.0, -1.5), "hard": (2.0, 1.5), "guess": (0.0, 0.0), "keyed-wrong": (-2.0, 0.0)}
    rows = []
    for learner in range(500):
        ability = chance.gauss(0, 1)
        for name, (slope, difficulty) in [*questions.items(), *((f"fill{n}", (2.0, 0.0)) for n in range(6))]:
            right = chance.random() < 1 / (1 + math.exp(-slope * (ability - difficulty)))
            rows.append(row(learner, name, float(right)))
    by_name = {question.question: question for question in statistics_of(rows)}
    assert by_name["easy"].difficulty.value > 0.8 > 0.2 > by_name["hard"].difficulty.value
    limits = {name: question.discrimination for name, question in by_name.items()}
    easy, guess, wrong = limits["easy"], limits["guess"], limits["keyed-wrong"]
    assert easy is not None and guess is not None and wrong is not None
    assert easy.low > 0.2
    assert guess.low < 0 < guess.high
    assert wrong.high < 0


def test_options_mistakes_and_first_attempts_are_counted() -> None:
    sign, unit = "Your number has the wrong sign.", "Your number would be right in s."
    rows = [
        row("a", "q", 1, option=1, diagnoses=json.dumps([sign, unit])),
        row("b", "q", 0, option=0, diagnoses=json.dumps([sign])),
        row("c", "q", 1, option=1, first_status=Status.INCORRECT),
    ]
    (question,) = statistics_of(rows)
    assert question.options == {0: 1, 1: 2}
    assert list(question.mistakes.items()) == [(sign, 2), (unit, 1)]
    assert question.right_at_once.value == pytest.approx(1 / 3)
    assert question.difficulty.value == pytest.approx(2 / 3)


def test_wrong_numbers_are_clustered_and_right_ones_are_not() -> None:
    numbers = [5.0, 5.01, 0.2, 0.2, 0.2003, 7, 9]
    rows = [row(n, "q", 0, value=value) for n, value in enumerate(numbers)]
    rows += [row("right", "q", 1, value=5.0), row("none", "q", 0)]
    (question,) = statistics_of(rows)
    assert [(cluster.value, cluster.learners) for cluster in question.clusters] == [(0.2, 3), (5.005, 2)]
    (tight,) = statistics_of(rows, {"q": [0.001]})
    assert [(cluster.value, cluster.learners) for cluster in tight.clusters] == [(0.2, 3)]


@given(st.lists(st.floats(-1e3, 1e3), max_size=30), st.none() | st.floats(0, 100), st.randoms())
def test_clusters_are_narrow_disjoint_and_independent_of_order(
    values: list[float], tolerance: float | None, chance: random.Random
) -> None:
    clusters = find_clusters(values, tolerance)
    assert [cluster.learners for cluster in clusters] == sorted(
        (cluster.learners for cluster in clusters), reverse=True
    )
    for cluster in clusters:
        assert cluster.learners >= 2
        assert cluster.low <= cluster.value <= cluster.high
        assert cluster.high - cluster.low <= (0.005 * abs(cluster.low) if tolerance is None else tolerance)
        assert cluster.learners == sum(cluster.low <= value <= cluster.high for value in values)
    for value in set(values):  # equal numbers are never split
        if values.count(value) > 1:
            assert any(cluster.low <= value <= cluster.high for cluster in clusters)
    shuffled = values.copy()
    chance.shuffle(shuffled)
    assert find_clusters(shuffled, tolerance) == clusters


def test_two_rows_of_a_learner_at_a_question_are_refused() -> None:
    with pytest.raises(ValueError, match="a learner has two rows at q"):
        statistics_of([row("a", "q", 1), row("a", "q", 0)])


def test_no_rows_have_no_statistics() -> None:
    assert statistics_of([]) == ()


def test_every_part_of_an_answer_is_counted() -> None:
    rows = [
        row("a", "ticked", 0, several='{"option": [0, 2]}'), row("b", "ticked", 1, several='{"option": [2]}'),
        row("c", "ticked", 0, several='{"option": []}'),
        row("a", "typed", 0, several='{"value": [5.0, null]}'), row("b", "typed", 0, several='{"value": [5.0, 7.0]}'),
        row("c", "typed", 0, several='{"value": [null, 7.25]}'),
        row("d", "typed", 1, several='{"value": [null, null]}'),
    ]  # fmt: skip
    ticked, typed = statistics_of(rows, {"typed": [0.01, 0.5]})
    assert ticked.options == {0: 1, 2: 2}
    assert [(cluster.number, cluster.value, cluster.learners) for cluster in typed.clusters] == [
        (0, 5.0, 2),
        (1, 7.125, 2),
    ]
    assert ticked.clusters == ()
    assert typed.options == {}


answers = st.fixed_dictionaries(
    {
        "points": st.sampled_from([0.0, 0.5, 1.0]),
        "first_status": st.sampled_from([Status.CORRECT, Status.INCORRECT]),
        "option": st.none() | st.integers(0, 2),
        "value": st.none() | st.sampled_from([1.0, 1.001, 2.0]),
        "diagnoses": st.lists(st.sampled_from(["a", "b", "c"]), unique=True).map(json.dumps),
        "several": st.sampled_from([None, '{"option": [0, 2]}', '{"option": [2]}', '{"value": [1.0, null, 2.0]}']),
    }
)


@given(st.dictionaries(st.tuples(st.integers(0, 9), st.sampled_from(["q", "r"])), answers, max_size=20))
def test_learners_who_answered_alike_are_counted_as_if_one_by_one(given_answers: dict[tuple[int, str], Any]) -> None:
    rows = [row(learner, question, **answer) for (learner, question), answer in given_answers.items()]
    by_question = {one.question: one for one in statistics_of(rows, {"r": [0.0]})}
    assert list(by_question) == list(dict.fromkeys(one.question for one in rows))
    for name, told in by_question.items():
        here = [one for one in rows if one.question == name]
        several = [json.loads(one.several or "{}") for one in here]
        options = [one.option for one in here if one.option is not None]
        options += [option for one in several for option in one.get("option", ())]
        assert told.options == dict(sorted(Counter(options).items()))
        assert told.mistakes == Counter(mistake for one in here for mistake in json.loads(one.diagnoses))
        assert told.difficulty == mean_share([one.points for one in here])
        assert told.right_at_once == mean_share([float(one.first_status == Status.CORRECT) for one in here])
        wrong = [one.value for one in here if one.value is not None and one.first_status != Status.CORRECT]
        parts = [list(part) for part in zip_longest(*(one.get("value", ()) for one in several))]
        columns = [[value for value in part if value is not None] for part in parts] or [wrong]
        expected = [
            replace(cluster, number=number)
            for number, values in enumerate(columns)
            for cluster in find_clusters(values, 0.0 if name == "r" and number == 0 else None)
        ]
        assert list(told.clusters) == expected


@pytest.mark.parametrize(
    ("diagnosis", "told"),
    [
        ("ZeroDivisionError: division by zero, in line 2 of your script.", "Ended with an error: ZeroDivisionError"),
        ("hidden case 1: IndexError, in line 8 of your script.", "Ended with an error: IndexError"),
        ("kp = 2000, kv = 5, Euler: TypeError: f() takes (a).", "Ended with an error: TypeError"),
        ("Rename a to b: the grader calls b.", "Rename a to b: the grader calls b."),
        ("The error is too large: RK4 has order 4.", "The error is too large: RK4 has order 4."),
        ("Line 3 raised a ValueError (no), and the `except` in line 4 hid it.",
         "Line 3 raised a ValueError (no), and the `except` in line 4 hid it."),
    ],
)  # fmt: skip
def test_crashes_are_counted_by_the_name_of_their_exception(diagnosis: str, told: str) -> None:
    assert group_crash(diagnosis) == told
