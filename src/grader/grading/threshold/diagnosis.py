"""Names the mistake: the first wrong method that would have given the student's claims."""

from collections.abc import Sequence

from mujoco import mjtJoint

from grader.grading.threshold.claims import Bracket
from grader.grading.threshold.methods import servo_of
from grader.grading.threshold.mistakes import METHODS
from grader.grading.threshold.parameters import Problem
from grader.grading.threshold.truth import Judged


def name_the_mistake(problem: Problem, judged: Sequence[Judged]) -> str | None:
    """The sentence of the first method that explains what is wrong, or None."""
    wrong = [one for one in judged if not one.right]
    for method in METHODS:
        claims = judged if method.all_claims else wrong
        if method.of_numbers and not any(isinstance(one.claim, Bracket) for one in wrong):
            continue
        if wrong and all(method.gives(problem, one.cell, one.claim) for one in claims):
            return method.sentence.format(**particulars(problem))
    return None


def particulars(problem: Problem) -> dict[str, str]:
    """What a sentence may say: the exercise's public numbers, and those of its first visible model."""
    parameters = problem.parameters
    visible = next((servo_of(cell) for cell in problem.cells if not cell.hidden), None)
    shift = (
        f": the servo's own damping lowers Euler's limit by kv/kp = {1000 * visible.kv / visible.kp:.3g} ms"
        if visible
        else ""
    )
    start = ", ".join(f"{joint} at {value:g} {unit_of(problem, joint)}" for joint, value in parameters.start.items())
    return {
        "shift": shift,
        "start": start,
        "width": f"{1000 * parameters.width_s:g}",
        "horizon": f"{parameters.horizon_s:g}",
    }


def unit_of(problem: Problem, joint: str) -> str:
    """Of a joint's coordinate."""
    kind = int(problem.as_in_the_file.model.joint(joint).type[0])
    return "m" if kind == int(mjtJoint.mjJNT_SLIDE) else "rad"
