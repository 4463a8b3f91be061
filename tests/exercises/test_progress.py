"""Which case a running script is at, by the names of its results."""

import pytest

from grader.exercises import Case, Progress, Trial, TrialProgress

LESSON, STIFF = Case(id="lesson"), Case(id="stiff", hidden=True)
TRIALS = [
    Trial("a", {}, None, case=STIFF, hidden=True),
    Trial("b", {}, None, case=LESSON),
    Trial("b", {}, None, case=LESSON),
    Trial("d", {}, None, hidden=True),
]


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ([], [1]),
        (["t1_claim", "t1_other"], [1]),
        (["t1_claim", "t2_claim", "t2_other"], [1, 2]),
        (["t1_claim", "t2_claim", "t0_raised", "t3_claim"], [1, 2]),
        (["t0_claim", "t2_claim"], [1, 2]),
        (["sample", "t99_claim", "t_claim", "t12345678_x", ""], [1]),
    ],
)
def test_visible_cases_are_counted_and_hidden_ones_are_one_step(names: list[str], told: list[int]) -> None:
    heard: list[tuple[int, int, TrialProgress | None]] = []
    progress = Progress(TRIALS, lambda *at: heard.append(at))
    for name in names:
        progress.follow(name)
    assert heard == [(case, 3, None) for case in told]


def test_a_visible_trial_tells_how_far_it_is_and_a_hidden_one_does_not() -> None:
    heard: list[tuple[int, int, TrialProgress | None]] = []
    progress = Progress(TRIALS, lambda *at: heard.append(at))
    names = (
        "t1_at_2_of_20_episode",
        "t0_at_1_of_4_s",
        "t2_at_5_of_4_s",
        "t2_at_3_of_4_s",
        "t2_claim",
        "t0_at_2_of_4_s",
    )
    for name in names:
        progress.follow(name)
    assert [(case, within and within.words) for case, _, within in heard] == [
        (1, None), (1, "episode 2 of 20"), (1, "3 of 4 s"), (2, None)
    ]  # fmt: skip
