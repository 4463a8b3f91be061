"""Which case a running script is at, by the names of its results."""

import pytest

from grader.exercises import Case, Progress, Trial

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
    heard: list[tuple[int, int]] = []
    progress = Progress(TRIALS, lambda *at: heard.append(at))
    for name in names:
        progress.follow(name)
    assert heard == [(case, 3) for case in told]
