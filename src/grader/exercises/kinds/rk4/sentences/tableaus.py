"""Says what is wrong with a tableau: the student's stages and weights beside the classical ones. `what` is what the
rows move: the whole "state", or the "position" or "velocity" alone."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from grader.exercises.kinds.rk4.combinations import format_coefficient
from grader.exercises.kinds.rk4.methods import (
    chain_stages,
    chain_stages_and_result,
    chain_views,
    compute_order,
    find_name,
    move_on_from,
    repeat_classical,
)
from grader.exercises.kinds.rk4.tableau import (
    CLASSICAL,
    COEFFICIENT_ATOL,
    Matrix,
    Row,
    is_same,
    is_same_row,
    look_up,
    look_up_row,
    pad_row,
)
from grader.exercises.rules import find_sentence
from grader.numerics.accuracy.runge_kutta import WEIGHTS

STAGES = len(CLASSICAL) - 1

FRACTIONS = {2: "h/2", 3: "h/2", 4: "h"}
"""How far the classical stages lie from the start, as a student writes it."""

ROUNDED_ATOL = 5e-3
"""Weights that are off by less are the classical ones, rounded to two decimals or more."""

CLASSICAL_STEP = "the classical step that was asked for (k1 to k4, weights 1, 2, 2, 1 over 6)"

STATE_ARRAYS = {"state": "data.qpos[:] and data.qvel[:]", "position": "data.qpos[:]", "velocity": "data.qvel[:]"}

SLOPE_NAMES = {"state": "velocity and acceleration", "position": "velocity", "velocity": "acceleration"}


def describe_method(rows: Matrix, what: str, positions: Matrix | None = None) -> str:
    """Returns the sentence of a tableau that is not the classical one. `positions`: that of the positions, where it is
    another."""
    calls = len(rows) - 1
    known = find_sentence((explain_named_method, explain_several_steps, explain_reused_slope), rows)
    if known is not None:
        return known
    if calls == STAGES:
        return describe_two_tableaus(positions, rows) if positions else describe_four_stages(rows, what)
    slopes = f"{spell_number(calls)} {'slope' if calls == 1 else 'slopes'}"
    order = compute_order(rows)
    if order >= 4:
        better = "of fifth order or more: better than fourth order" if order > 4 else "of fourth order"
        return f"This method takes {slopes} and is {better}, but it is not {CLASSICAL_STEP}."
    return (
        f"Your step takes {slopes} and moves the {what} by {write_row(rows[-1])}, which is of order {order}: take "
        "four, k1 at the start, k2 and k3 at h/2, k4 at h, with weights 1, 2, 2, 1 over 6."
    )


def explain_named_method(rows: Matrix) -> str | None:
    """Returns the sentence of a method that has a name."""
    name = find_name(rows)
    if name is None:
        return None
    if compute_order(rows) >= STAGES:
        return f"This is {name}: fourth order, but not {CLASSICAL_STEP}; its stages lie at 0, h/2, h/2 and h."
    return f"This is {name}. The classical method takes four slopes: k1 at the start, k2 and k3 at h/2, k4 at h."


def explain_several_steps(rows: Matrix) -> str | None:
    """Returns the sentence of a function that takes more than one classical step."""
    for times in (2, 3, 4):
        if is_same(rows, repeat_classical(times, 1.0)):
            return (
                f"One call of your function takes {spell_number(times)} whole steps: advance data by "
                "model.opt.timestep once."
            )
        if is_same(rows, repeat_classical(times, 1 / times)):
            return (
                f"Your function takes {spell_number(times)} classical steps of h/{times}: nearer to the truth, but one "
                "classical step of h was asked for."
            )
    return None


REUSED_WEIGHTS: Mapping[tuple[float, ...], str] = {
    (1 / 6, 1 / 3, 1 / 2): "k3 is used twice",
    (1 / 6, 1 / 2, 1 / 3): "k2 is used in its place",
    (1 / 3, 1 / 3, 1 / 3): "k1 is used in its place",
    (1 / 6, 1 / 3, 1 / 3): "its part of the sum is missing",
}
"""Weights of three slopes, where the fourth is missing."""


def explain_reused_slope(rows: Matrix) -> str | None:
    """Returns the sentence of three classical stages with another slope in place of the third or fourth."""
    if is_same(rows, [(), (1 / 2,), (0, 1), (1 / 6, 2 / 3, 1 / 6)]):
        return (
            "Your third stage is never evaluated: k2 is used in its place. Evaluate k3 at half the step too, with k2; "
            "what is kept by time alone gives k2 again, since both lie at t + h/2."
        )
    if len(rows) != STAGES or not is_same([*rows[:-1], ()], [*CLASSICAL[:3], ()]):
        return None
    reuse = look_up_row(rows[-1], REUSED_WEIGHTS)
    return (
        f"Your fourth stage is never evaluated: {reuse}. Evaluate k4 at the end of the step, with k3."
        if reuse
        else None
    )


def describe_four_stages(rows: Matrix, what: str) -> str:
    """Returns the sentence of four stages that are not the classical ones, or have other weights."""
    return join_mistakes([sentence for _, sentence in list_mistakes(rows, what)])


def describe_two_tableaus(positions: Matrix, velocities: Matrix) -> str:
    """Returns the sentence of positions and velocities that each move by four stages. A row that is wrong in the same
    way for both is one mistake of the state."""
    both, only_positions, only_velocities = [], [], []
    for one, other, right in zip(positions, velocities, CLASSICAL, strict=True):
        alike = is_same_row(one, other)
        both.append(one if alike else right)
        only_positions.append(right if alike else one)
        only_velocities.append(right if alike else other)
    mistakes = [
        *list_mistakes(both, "state"),
        *list_mistakes(only_positions, "position"),
        *list_mistakes(only_velocities, "velocity"),
    ]
    return join_mistakes([sentence for _, sentence in sorted(mistakes, key=lambda mistake: mistake[0])])


def list_mistakes(rows: Matrix, what: str) -> Iterator[tuple[int, str]]:
    """Yields what is wrong with four stages and their weights, each with the number of the first wrong row, from 1."""
    wrong = [row for row in range(1, STAGES + 2) if not is_same_row(rows[row - 1], CLASSICAL[row - 1])]
    stages = [row for row in wrong if row <= STAGES]
    if (known := look_up(rows, CHAINED_STAGES)) is not None:
        yield wrong[0], add_subject(what, known)
        return
    if (several := explain_several_stages(rows, stages)) is not None:
        yield stages[0], add_subject(what, several)
    else:
        yield from ((stage, describe_stage(stage, rows[stage - 1], what)) for stage in stages)
    if len(wrong) > len(stages):
        yield wrong[-1], describe_weights(rows[-1], what)


ORDINALS = ("First", "Second", "Third")


def join_mistakes(sentences: Sequence[str]) -> str:
    """Returns what is wrong as one text: how many things, and the first three of them."""
    if len(sentences) == 1:
        return sentences[0]
    named = " ".join(f"{place}: {sentence}" for place, sentence in zip(ORDINALS, sentences, strict=False))
    return f"{spell_number(len(sentences)).capitalize()} things are wrong. {named}"


def add_subject(what: str, sentence: str) -> str:
    """Returns a sentence that says what it is about, where that is not the whole state."""
    return sentence if what == "state" else f"For the {what}: {sentence[0].lower()}{sentence[1:]}"


CHAINED_STAGES: Mapping[str, Matrix] = {
    "Each of your stages starts from the state of the stage before; restore q and v to the start of the step "
    "before every stage.": chain_stages(CLASSICAL),
    "The state is not restored between the stages: q and v alias data.qpos and data.qvel, so copy them at the start of "
    "the step (data.qpos.copy()); and move a copy by y + h/2 * k, "
    "because y += ... changes y itself.": chain_stages_and_result(CLASSICAL),
    "The state is not restored between the stages, and all slopes equal the last one: q, v and the slopes are views, "
    "which data goes on changing, so copy each of them (data.qpos.copy(), data.qacc.copy()).": chain_views(CLASSICAL),
    "Stages 3 and 4 and the weighted sum start from the state of stage 2: move a copy by y + h/2 * k1, because "
    "y += ... changes y itself.": move_on_from(2),
    "Stage 4 and the weighted sum start from the state of stage 3: move a copy by y + h/2 * k2, because y += ... "
    "changes y itself.": move_on_from(3),
    "The weighted sum is added to the state of your last stage: restore the state at the start of the step "
    "before you add it.": (*CLASSICAL[:-1], (pad_row(CLASSICAL[3], STAGES) + WEIGHTS).tolist()),
    "After your step data stands at your last stage: the weighted sum h (k1 + 2 k2 + 2 k3 + k4)/6 is never written.": (
        *CLASSICAL[:-1],
        CLASSICAL[3],
    ),
}
"""Stages, or a result, that do not start from the start of the step."""


def explain_several_stages(rows: Matrix, wrong: Sequence[int]) -> str | None:
    """Returns the sentence of several stages with one mistake."""
    stages = [*rows[:-1], ()]
    if is_same(stages, [(), (1,), (0, 1), (0, 0, 1), ()]):
        return "Your stages 2 and 3 are evaluated at the end of the step; evaluate them at half the step."
    if is_same(stages, [(), (1 / 2,), (1 / 2, 0), (1, 0, 0), ()]):
        return (
            "Your stages 2, 3 and 4 all use the first slope; use the slope of the stage before (k2 for stage 3, k3 for "
            "stage 4)."
        )
    alone = all(np.count_nonzero(np.abs(rows[i - 1]) > COEFFICIENT_ATOL) == 1 for i in wrong)
    ratios = [rows[i - 1][i - 2] / CLASSICAL[i - 1][i - 2] for i in wrong if i > 1]
    if alone and len(wrong) == len(ratios) > 1 and ratios[0] and np.allclose(ratios, ratios[0], rtol=0, atol=1e-6):
        *first, last = (f"{FRACTIONS[i]} k{i - 1}" for i in wrong)
        *before, behind = map(str, wrong)
        return (
            f"Your stages {', '.join(before)} and {behind} lie {format_coefficient(ratios[0])} times as far from "
            f"the start as they should: move by {', '.join(first)} and {last}."
        )
    return None


def describe_stage(stage: int, row: Row, what: str) -> str:
    """Returns the sentence of one wrong stage."""
    used = [(j, value) for j, value in enumerate(row, 1) if abs(value) > COEFFICIENT_ATOL]
    subject = f"Your stage {stage}" if what == "state" else f"In your stage {stage}, the {what}"
    if stage == 1:
        return f"{subject} moves by {write_row(row)}: evaluate k1 at the start of the step, before anything moves."
    right = f"{FRACTIONS[stage]} k{stage - 1}"
    if not used:
        return (
            f"{subject} is still at the start of the step when mj_forward is called: write {STATE_ARRAYS[what]} before "
            f"that, moved by {right}."
        )
    if len(used) == 1 and used[0][0] != stage - 1:
        slope = used[0][0]
        name = "the first slope again" if slope == 1 else f"the slope of stage {slope}"
        return (
            f"{subject} uses {name}: it moves by {write_row(row)}, not by {right}. Use the {SLOPE_NAMES[what]} of "
            f"stage {stage - 1}."
        )
    if len(used) == 1 and what == "state":
        if stage == STAGES and abs(used[0][1] - 1 / 2) <= COEFFICIENT_ATOL:
            return "Your last stage is evaluated at half the step; evaluate it at the end."
        if stage == STAGES - 1 and abs(used[0][1] - 1) <= COEFFICIENT_ATOL:
            return "Your stage 3 is evaluated at the end of the step; evaluate it at half the step, like stage 2."
    return f"{subject} moves by {write_row(row)}; it should move by {right} from the start of the step."


WRONG_WEIGHTS: Mapping[tuple[float, ...], str] = {
    (1 / 4,) * 4: "All four slopes have the same weight; the classical weights are 1, 2, 2, 1 over 6.",
    (1 / 8, 3 / 8, 3 / 8, 1 / 8): (
        "The weights are those of the 3/8 rule (1, 3, 3, 1 over 8); the classical ones are 1, 2, 2, 1 over 6."
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


def describe_weights(row: Row, what: str) -> str:
    """Returns the sentence of wrong weights on the classical stages."""
    known = look_up_row(row, WRONG_WEIGHTS)
    if known is not None:
        return add_subject(what, known)
    whose = "Your" if what == "state" else f"For the {what}, your"
    total = sum(row)
    if abs(total) > COEFFICIENT_ATOL and is_same_row(row, (total * np.array(WEIGHTS)).tolist()):
        return describe_scale(total, what)
    if any(value < -COEFFICIENT_ATOL for value in row):
        return (
            f"{whose} step subtracts a slope: it moves by {write_row(row)}. All four weights are positive, 1, 2, 2, 1 "
            "over 6."
        )
    if len(row) == len(WEIGHTS) and np.allclose(np.array(row), WEIGHTS, rtol=0, atol=ROUNDED_ATOL):
        texts = ", ".join(f"{value:.4g}" for value in row)
        return f"{whose} weights are {texts}, which is 1/6 and 1/3 rounded: write h / 6 * (k1 + 2 k2 + 2 k3 + k4)."
    texts = ", ".join(format_coefficient(value) for value in row)
    tail = "" if abs(total - 1) <= COEFFICIENT_ATOL else f" and sum to {format_coefficient(total)}, not to 1"
    return f"{whose} weights are {texts}{tail}; the classical weights are 1/6, 1/3, 1/3, 1/6."


def describe_scale(total: float, what: str) -> str:
    """Returns the sentence of the classical weights divided by another number than 6; `total` is their sum."""
    start = "The" if what == "state" else f"For the {what}, the"
    if total > 6:
        by = f"multiplied by {format_coefficient(total / 6)}, not divided by 6"
    else:
        by = f"divided by {format_coefficient(6 / total)}, not by 6"
    return f"{start} weights 1, 2, 2, 1 are {by}: they do not sum to 1."


def write_row(row: Row, symbol: str = "k") -> str:
    """Returns a row as a student would write it, such as "h/2 k1"."""
    parts: list[str] = []
    for index, value in enumerate(row, 1):
        if abs(value) <= COEFFICIENT_ATOL:
            continue
        top, _, bottom = format_coefficient(abs(value)).partition("/")
        size = f"{'' if top == '1' else top + ' '}h{'/' + bottom if bottom else ''}"
        sign = "- " if value < 0 else "+ " if parts else ""
        parts.append(f"{sign}{size} {symbol}{index}")
    return " ".join(parts) or "nothing"


def spell_number(count: int) -> str:
    """Returns a small number in words."""
    words = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight")
    return words[count] if count < len(words) else str(count)


def join_words(words: Sequence[str]) -> str:
    """Returns words as a list in a sentence, such as "2, 3 and 4"."""
    *before, last = words
    return f"{', '.join(before)} and {last}" if before else last


VIEW_WEIGHTS: Mapping[tuple[float, ...], int] = {
    (0, 1 / 3, 1 / 3, 1 / 3): 1, (1 / 6, 0, 1 / 3, 1 / 2): 2, (1 / 6, 1 / 3, 0, 1 / 2): 3
}  # fmt: skip
"""Weights that count the last slope in place of the one of a stage."""


def explain_view(rows: Matrix, name: str) -> str | None:
    """Returns the sentence of one slope that is counted as the last one; None if none is."""
    stage = next((stage for weights, stage in VIEW_WEIGHTS.items() if is_same_row(rows[-1], weights)), None)
    if stage is None or not is_same([*rows[:-1], ()], [*CLASSICAL[:-1], ()]):
        return None
    return (
        f"In your sum the last data.{name} stands in the place of that of stage {stage}: data.{name} is a view that "
        f"later stages overwrite. Copy it in stage {stage} as in the others, with data.{name}.copy()."
    )
