"""Says what is wrong with a tableau: the student's stages and weights beside the classical ones.

`what` is what the rows move: the whole "state", or the "position" or "velocity" alone.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from grader.exercises.kinds.rk4.fits import as_text
from grader.exercises.kinds.rk4.methods import added_up, from_the_last, name_of, order_of, repeated
from grader.exercises.kinds.rk4.tableau import CLASSICAL, SAME, Matrix, Row, padded, same, same_row
from grader.numerics.runge_kutta import WEIGHTS

STAGES = len(CLASSICAL) - 1

FRACTIONS = {2: "h/2", 3: "h/2", 4: "h"}
"""How far the classical stages lie from the start, as a student writes it."""

ROUNDED = 5e-3
"""Weights that are off by less are the classical ones, rounded to two decimals or more."""

ASKED = "the classical step that was asked for (k1 to k4, weights 1, 2, 2, 1 over 6)"

WRITTEN = {"state": "data.qpos[:] and data.qvel[:]", "position": "data.qpos[:]", "velocity": "data.qvel[:]"}

SLOPE_OF = {"state": "velocity and acceleration", "position": "velocity", "velocity": "acceleration"}


def method_sentence(rows: Matrix, what: str) -> str:
    """Returns the sentence of a tableau that is not the classical one."""
    calls = len(rows) - 1
    known = named_sentence(rows) or several_steps(rows) or reused(rows)
    if known:
        return known
    if calls == STAGES:
        return four_stages(rows, what)
    slopes = f"{number_word(calls)} {'slope' if calls == 1 else 'slopes'}"
    order = order_of(rows)
    if order >= 4:
        better = "of fifth order or more: better than fourth order" if order > 4 else "of fourth order"
        return f"This method takes {slopes} and is {better}, but it is not {ASKED}."
    return (
        f"Your step takes {slopes} and moves the {what} by {in_words(rows[-1])}, which is of order {order}: take four, "
        "k1 at the start, k2 and k3 at h/2, k4 at h, with weights 1, 2, 2, 1 over 6."
    )


def named_sentence(rows: Matrix) -> str | None:
    """Returns the sentence of a method that has a name."""
    name = name_of(rows)
    if name is None:
        return None
    if order_of(rows) >= STAGES:
        return f"This is {name}: fourth order, but not {ASKED}; its stages lie at 0, h/2, h/2 and h."
    return f"This is {name}. The classical method takes four slopes: k1 at the start, k2 and k3 at h/2, k4 at h."


def several_steps(rows: Matrix) -> str | None:
    """Returns the sentence of a function that takes more than one classical step."""
    for times in (2, 3, 4):
        if same(rows, repeated(times, 1.0)):
            return (
                f"One call of your function takes {number_word(times)} whole steps: advance data by model.opt.timestep "
                "once."
            )
        if same(rows, repeated(times, 1 / times)):
            return (
                f"Your function takes {number_word(times)} classical steps of h/{times}: nearer to the truth, but one "
                "classical step of h was asked for."
            )
    return None


REUSED: Mapping[tuple[float, ...], str] = {
    (1 / 6, 1 / 3, 1 / 2): "k3 is used twice",
    (1 / 6, 1 / 2, 1 / 3): "k2 is used in its place",
    (1 / 3, 1 / 3, 1 / 3): "k1 is used in its place",
    (1 / 6, 1 / 3, 1 / 3): "its part of the sum is missing",
}
"""Weights of three slopes, where the fourth is missing."""


def reused(rows: Matrix) -> str | None:
    """Returns the sentence of three classical stages with another slope in place of the third or fourth."""
    if same(rows, [(), (1 / 2,), (0, 1), (1 / 6, 2 / 3, 1 / 6)]):
        return (
            "Your third stage is never evaluated: k2 is used in its place. Evaluate k3 at half the step too, with k2; "
            "what is kept by time alone gives k2 again, since both lie at t + h/2."
        )
    if len(rows) != STAGES or not same([*rows[:-1], ()], [*CLASSICAL[:3], ()]):
        return None
    found = next((text for weights, text in REUSED.items() if same_row(rows[-1], weights)), None)
    return (
        f"Your fourth stage is never evaluated: {found}. Evaluate k4 at the end of the step, with k3."
        if found
        else None
    )


def four_stages(rows: Matrix, what: str) -> str:
    """Returns the sentence of four stages that are not the classical ones, or have other weights."""
    wrong = [stage for stage in range(1, STAGES + 1) if not same_row(rows[stage - 1], CLASSICAL[stage - 1])]
    known = chained(rows) or several_stages(rows, wrong)
    if known:
        return about(what, known)
    return stage_sentence(wrong[0], rows[wrong[0] - 1], what) if wrong else weights_sentence(rows[-1], what)


def about(what: str, sentence: str) -> str:
    """Returns a sentence that says what it is about, where that is not the whole state."""
    return sentence if what == "state" else f"For the {what}: {sentence[0].lower()}{sentence[1:]}"


def chained(rows: Matrix) -> str | None:
    """Returns the sentence of stages, or of a sum, that do not start from the start of the step."""
    if same(rows, added_up(CLASSICAL)):
        return (
            "Each of your stages starts from the state of the stage before; restore q and v to the start of the step "
            "before every stage."
        )
    if same(rows, from_the_last(CLASSICAL)):
        return (
            "The state is not restored between the stages: q and v alias data.qpos and data.qvel, so copy them at the "
            "start of the step (data.qpos.copy()); and move a copy by y + h/2 * k, because y += ... changes y itself."
        )
    if same(rows, [*CLASSICAL[:-1], (padded(CLASSICAL[3], STAGES) + WEIGHTS).tolist()]):
        return (
            "The weighted sum is added to the state of your last stage: restore the state at the start of the step "
            "before you add it."
        )
    if same(rows, [*CLASSICAL[:-1], CLASSICAL[3]]):
        return (
            "After your step data stands at your last stage: the weighted sum h (k1 + 2 k2 + 2 k3 + k4)/6 is never "
            "written."
        )
    return None


def several_stages(rows: Matrix, wrong: Sequence[int]) -> str | None:
    """Returns the sentence of several stages with one mistake."""
    stages = [*rows[:-1], ()]
    if same(stages, [(), (1,), (0, 1), (0, 0, 1), ()]):
        return "Your stages 2 and 3 are evaluated at the end of the step; evaluate them at half the step."
    if same(stages, [(), (1 / 2,), (1 / 2, 0), (1, 0, 0), ()]):
        return (
            "Your stages 2, 3 and 4 all use the first slope; use the slope of the stage before (k2 for stage 3, k3 for "
            "stage 4)."
        )
    alone = all(np.count_nonzero(np.abs(stage) > SAME) == 1 for stage in rows[1:-1])
    ratios = {round(rows[i][i - 1] / CLASSICAL[i][i - 1], 6) for i in (1, 2, 3)}
    if list(wrong) == [2, 3, 4] and alone and len(ratios) == 1 and ratios != {0.0}:
        return (
            f"Your stages 2, 3 and 4 lie {as_text(ratios.pop())} times as far from the start as they should: move by "
            "h/2 k1, h/2 k2 and h k3."
        )
    return None


def stage_sentence(stage: int, row: Row, what: str) -> str:
    """Returns the sentence of one wrong stage."""
    used = [(j, value) for j, value in enumerate(row, 1) if abs(value) > SAME]
    subject = f"Your stage {stage}" if what == "state" else f"In your stage {stage}, the {what}"
    if stage == 1:
        return f"{subject} moves by {in_words(row)}: evaluate k1 at the start of the step, before anything moves."
    right = f"{FRACTIONS[stage]} k{stage - 1}"
    if not used:
        return (
            f"{subject} is still at the start of the step when mj_forward is called: write {WRITTEN[what]} before "
            f"that, moved by {right}."
        )
    if len(used) == 1 and used[0][0] != stage - 1:
        slope = used[0][0]
        name = "the first slope again" if slope == 1 else f"the slope of stage {slope}"
        return (
            f"{subject} uses {name}: it moves by {in_words(row)}, not by {right}. Use the {SLOPE_OF[what]} of stage "
            f"{stage - 1}."
        )
    if len(used) == 1 and what == "state":
        if stage == STAGES and abs(used[0][1] - 1 / 2) <= SAME:
            return "Your last stage is evaluated at half the step; evaluate it at the end."
        if stage == STAGES - 1 and abs(used[0][1] - 1) <= SAME:
            return "Your stage 3 is evaluated at the end of the step; evaluate it at half the step, like stage 2."
    return f"{subject} moves by {in_words(row)}; it should move by {right} from the start of the step."


WEIGHTS_SAID: Mapping[tuple[float, ...], str] = {
    (1 / 4,) * 4: "All four slopes have the same weight; the classical weights are 1, 2, 2, 1 over 6.",
    (1 / 8, 3 / 8, 3 / 8, 1 / 8): (
        "The weights are those of the 3/8 rule (1, 3, 3, 1 over 8) on the classical stages; use 1, 2, 2, 1 over 6."
    ),
    (1 / 6,) * 4: "The weights do not sum to 1: the middle slopes count twice (1, 2, 2, 1 over 6).",
    (1,) * 4: "The four slopes are added up without weights: use 1, 2, 2, 1 over 6.",
    (1, 2, 2, 1): "The weights 1, 2, 2, 1 are not divided by 6: they do not sum to 1.",
    (1 / 3, 1 / 6, 1 / 6, 1 / 3): (
        "The first and the last slope have the weight 2, the others 1; the classical weights are 1, 2, 2, 1."
    ),
    (1 / 6, 1 / 3, 1 / 2, 0): "Your k4 is evaluated but not used: k3 counts in its place. Give k4 the weight 1/6.",
    (1 / 6, 1 / 3, 1 / 3, 0): "Your k4 is evaluated but not used in the sum: its weight is 1/6.",
    (1 / 6, 2 / 3, 0, 1 / 6): "Your k2 is used twice and k3 not at all: the classical weights are 1, 2, 2, 1 over 6.",
    (1 / 6, 0, 2 / 3, 1 / 6): "Your k3 is used twice and k2 not at all: the classical weights are 1, 2, 2, 1 over 6.",
    (1 / 3, 1 / 3, 1 / 3, 0): "Your k1 is used in place of k4 in the sum; k4 has the weight 1/6.",
    (1, 0, 0, 0): "Only the first slope is used, though four are evaluated: weigh them 1, 2, 2, 1 over 6.",
    (0, 0, 0, 1): (
        "All slopes equal the last one: data.qvel and data.qacc are views that the next mj_forward overwrites, so copy "
        "them."
    ),
}
"""Wrong weights of the classical stages."""


def weights_sentence(row: Row, what: str) -> str:
    """Returns the sentence of wrong weights on the classical stages."""
    known = next((text for weights, text in WEIGHTS_SAID.items() if same_row(row, weights)), None)
    if known:
        return about(what, known)
    whose = "Your" if what == "state" else f"For the {what}, your"
    total = sum(row)
    if abs(total) > SAME and np.allclose(np.array(row), total * np.array(WEIGHTS), rtol=0, atol=SAME):
        start = "The" if what == "state" else f"For the {what}, the"
        by = (
            f"multiplied by {as_text(total / 6)}, not divided by 6" if total > 6 else f"divided by {as_text(6 / total)}"
        )
        return f"{start} weights 1, 2, 2, 1 are {by}{', not by 6' if total <= 6 else ''}: they do not sum to 1."
    if any(value < -SAME for value in row):
        return (
            f"{whose} step subtracts a slope: it moves by {in_words(row)}. All four weights are positive, 1, 2, 2, 1 "
            "over 6."
        )
    if len(row) == len(WEIGHTS) and np.allclose(np.array(row), WEIGHTS, rtol=0, atol=ROUNDED):
        texts = ", ".join(f"{value:.4g}" for value in row)
        return f"{whose} weights are {texts}, which is 1/6 and 1/3 rounded: write h / 6 * (k1 + 2 k2 + 2 k3 + k4)."
    texts = ", ".join(as_text(value) for value in row)
    tail = "" if abs(total - 1) <= SAME else f" and sum to {as_text(total)}, not to 1"
    return f"{whose} weights are {texts}{tail}; the classical weights are 1/6, 1/3, 1/3, 1/6."


def in_words(row: Row, symbol: str = "k") -> str:
    """Returns a row as a student would write it, such as "h/2 k1"."""
    parts: list[str] = []
    for index, value in enumerate(row, 1):
        if abs(value) <= SAME:
            continue
        top, _, bottom = as_text(abs(value)).partition("/")
        size = f"{'' if top == '1' else top + ' '}h{'/' + bottom if bottom else ''}"
        sign = "- " if value < 0 else "+ " if parts else ""
        parts.append(f"{sign}{size} {symbol}{index}")
    return " ".join(parts) or "nothing"


def number_word(count: int) -> str:
    """Returns a small number in words."""
    words = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight")
    return words[count] if count < len(words) else str(count)
