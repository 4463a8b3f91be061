"""What the learners of a demo course answer: the reference programs of an exercise, options, numbers as people type
them, and a few sentences where a person reads."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from grader.domain.verdict import Status
from grader.grading.references import ReferenceProgram, find_references
from grader.library import Library
from grader.questions import OptionKey, Question, kind_of

COMMON = frozenset({
    "constants", "returns_the_bound", "forgets_kv", "the_first_overshoot", "damping_in_the_joint", "no_such_function",
    "never_sets_the_integrator", "bracket_too_wide", "half_a_second", "in_milliseconds", "looks_at_the_end_only",
    "stage_three_from_the_first_slope", "forgets_time", "forgets_activations", "semi_implicit_stages", "equal_weights",
    "state_aliases_data", "h_twice", "the_starter", "euler", "heun", "weights_over_four",
})  # fmt: skip
"""The mistakes of our exercises that many make, by the end of the file's name."""

COMMON_WEIGHT = 8

WRONG_FACTORS = (2.0, 0.5, 2.0, 1e-3, 1.4142, 1e3, 0.1)
"""What wrong numbers are to the right one: a forgotten factor, another unit, a root too much."""

ON_TIMESTEPS = """
I would check that nothing diverges at the larger step: count MuJoCo's warnings over a full episode, and compare \
trajectories from the same states. If the success rate of a fixed policy drops, I would keep 2 ms.
I'd run the existing policy and look whether it still works. If it looks fine I would accept it, because training is \
five times faster.
First stability (data.warning), then accuracy: contact forces in a grasp at 2 ms and at 10 ms. Maybe implicitfast \
makes 10 ms possible. Reject if the contacts change, since then it is a different task.
With h = 10 ms the integrator is less accurate, so the simulation may explode. I would plot the energy.
Compare the return of the trained policy at both timesteps over 100 episodes with the same seeds, and count bad \
accelerations. Reject it when either differs by more than the noise between seeds.
"""
ON_THE_BOUND = """
The damper is explicit under Euler, so it lowers the limit by about kv/kp. implicitfast takes it implicitly, so the \
sign turns and the limit is higher. discrete is implicit in position too, so there is no limit.
The bound holds for a spring alone. My numbers were 20.0 ms under Euler and 25.1 ms under implicitfast, which lie on \
both sides of 22.4 ms. I think that is the damping, but I am not sure about the sign.
It is less than the bound because of numerical errors.
I measured 20.05 ms, and the formula gives 22.4 ms. The difference is kv/kp = 2.5 ms, as the formula has no damping.
"""
OPEN_ANSWERS = {"q4": ON_TIMESTEPS, "servo-explain": ON_THE_BOUND}
"""What people write, a line each, by question; anything for any other question."""


@dataclass(frozen=True)
class AnswerPool:
    """Answers to one question: right and wrong ones, with a weight each. Open answers are neither."""

    right: tuple[Any, ...]
    wrong: tuple[Any, ...]
    weights: tuple[int, ...]
    is_script: bool = False
    is_open: bool = False

    def draw(self, rng: Random, *, is_right: bool, used: Sequence[Any]) -> Any:
        """Returns an answer that was not `used` before, as far as there is one."""
        if is_right or self.is_open:
            return rng.choice(self.right)
        left = [(answer, weight) for answer, weight in zip(self.wrong, self.weights, strict=True) if answer not in used]
        some, weights = zip(*(left or zip(self.wrong, self.weights, strict=True)), strict=True)
        return rng.choices(some, weights)[0]


def build_pools(library: Library) -> dict[tuple[str, str], AnswerPool]:
    """Returns the answers to every question that some can be made up for, by quiz and question. Exercises without
    reference programs have none, and neither have questions whose keys are neither one option nor one number."""
    programs: dict[tuple[str, str], list[ReferenceProgram]] = {}
    for reference in find_references(library.root):
        if isinstance(reference, ReferenceProgram):
            programs.setdefault((reference.quiz, reference.question), []).append(reference)
    pools = {}
    for quiz in library.quizzes.values():
        for question in quiz.questions:
            pool = build_pool(question, programs.get((quiz.id, question.id), []))
            if pool is not None:
                pools[quiz.id, question.id] = pool
    return pools


def build_pool(question: Question, programs: Sequence[ReferenceProgram]) -> AnswerPool | None:
    """Returns the answers to one question; None where there are none."""
    kind = kind_of(question)
    if kind.is_script:
        return pool_programs(question, programs)
    if kind.is_prose:
        texts = OPEN_ANSWERS.get(question.id, ON_TIMESTEPS).strip().splitlines()
        return AnswerPool(tuple(texts), (), (), is_open=True)
    keys = kind.answer_keys(question)
    if len(keys) != 1:
        return None
    key = keys[0]
    if isinstance(key, OptionKey):
        wrong = tuple(place for place in range(len(key.options)) if place != key.answer)
        return AnswerPool((key.answer,), wrong, tuple(range(len(wrong), 0, -1)))
    wrong_numbers = tuple(f"{factor * key.answer:.4g}" for factor in WRONG_FACTORS)
    return AnswerPool(tuple(list_typed(key.answer, key.unit)), wrong_numbers, tuple(range(len(wrong_numbers), 0, -1)))


def pool_programs(question: Question, programs: Sequence[ReferenceProgram]) -> AnswerPool | None:
    """Returns the reference programs of an exercise without what cheats, which is rarer than the folder has it."""
    honest = [program for program in programs if "cheat" not in program.file]
    right = [program for program in honest if program.status == Status.CORRECT]
    wrong = [program for program in honest if program.status != Status.CORRECT]
    if not right or not wrong:
        return None
    weights = tuple(COMMON_WEIGHT if name_mistake(program) in COMMON else 1 for program in wrong)
    rights, wrongs = (tuple(make_answer(question, program) for program in some) for some in (right, wrong))
    return AnswerPool(rights, wrongs, weights, is_script=True)


def name_mistake(program: ReferenceProgram) -> str:
    """Returns the end of the file's name: `incorrect__forgets_kv.py` is `forgets_kv`."""
    return Path(program.file).stem.partition("__")[2]


DEMANDS = ("# diagnosis:", "# from MuJoCo", "<!-- diagnosis:", "<!-- from MuJoCo")


def make_answer(question: Question, program: ReferenceProgram) -> Any:
    """Returns a program as a learner hands it in: without the comments that say what it must get."""
    lines = program.source.splitlines(keepends=True)
    text = "".join(line for line in lines if not line.startswith(DEMANDS))
    return kind_of(question).from_text(question, text)


def list_typed(value: float, unit: str | None) -> Iterator[str]:
    """Yields a number as people type it."""
    yield f"{value:g}"
    yield f"{value:g} {unit}" if unit else f"{value:g}"
    yield f"{value:.3g}"
