"""A kind that plays, the smallest: a number is guessed by halving, and only "lower" and "higher" enter the jail."""

import json
import struct
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from grader.domain.verdict import Status, Verdict
from grader.exercises import (
    Ask,
    Case,
    DrawnCase,
    ExerciseParameters,
    Judgement,
    Kind,
    MalformedAnswer,
    Part,
    Trial,
    judge_exercise,
    plan_exercise,
)
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from support.kinds import install_kinds

pytestmark = pytest.mark.jail

DRIVER = """
import struct

def trial(functions, inputs, submit):
    (guess,) = functions
    message = exchange(None)
    while message is not None:
        try:
            answer = struct.pack("<d", guess(message.decode()))
        except Exception as error:
            answer = b"X" + explain(error)
        message = exchange(answer)
"""
CALLS = 20


class Halving(Kind[ExerciseParameters, float, None]):
    """A number between 0 and 1, to a thousandth, in ten guesses."""

    parameters = ExerciseParameters
    driver = DRIVER
    needs_model = False
    plays = True

    def build_trials(self, parameters: ExerciseParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[float]]:
        return [Trial(drawn.case.id, {}, float(drawn.rng.uniform()), cpu_s=2)]

    def play(self, parameters: ExerciseParameters, trial: Trial[float], ask: Ask) -> list[float] | str:
        guesses, hint = list[float](), "begin"
        for _ in range(CALLS):
            answer = ask(hint.encode())
            if answer[:1] == b"X":
                return str(json.loads(answer[1:])["raised"])
            if len(answer) != 8:
                raise MalformedAnswer
            guesses.append(struct.unpack("<d", answer)[0])
            hint = "lower" if guesses[-1] > trial.problem else "higher"
        return guesses

    def judge(self, parameters: ExerciseParameters, trial: Trial[float], results: Any) -> Judgement[None]:
        if isinstance(results, str):
            return Judgement(False, f"{results}.", None, crashed=True)
        near = abs(results[-1] - trial.problem) < 1e-3
        soon = any(abs(guess - trial.problem) < 1e-3 for guess in results[:12])
        parts = (
            Part("near", "the last guess", near, "It is near." if near else "It is not near.", points=3),
            Part("soon", "twelve guesses", soon, "Soon enough." if soon else "Not soon enough."),
        )
        return Judgement(
            near and soon, next((part.message for part in parts if not part.passed), ""), None, parts=parts
        )


RIGHT = """
ends = [0.0, 1.0]

def guess(hint):
    global ends
    if hint == "begin":
        ends = [0.0, 1.0]
    else:
        ends[hint == "lower"] = sum(ends) / 2
    return sum(ends) / 2
"""


@pytest.fixture
def grade(jail: Jail, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Verdict]:
    install_kinds(monkeypatch, halving=Halving())
    check = {"kind": "halving", "cases": [{"id": "seen"}, {"id": "unseen", "hidden": True}]}
    question = ScriptQuestion.model_validate(
        {"kind": "code", "id": "h", "q": "?", "points": 8, "entry": "guess", "check": check}
    )

    def grade(source: str) -> Verdict:
        plan = plan_exercise(question, lambda name: "", 1)
        return judge_exercise(question, plan, jail.run(plan.build_job(source, question.limits)), jail.run)

    return grade


def test_each_part_is_a_finding_with_its_points(grade: Callable[[str], Verdict]) -> None:
    verdict = grade(RIGHT)
    assert verdict.status is Status.CORRECT, verdict.diagnosis
    assert [(finding.id, finding.points) for finding in verdict.findings] == [
        ("seen.near", 3), ("seen.soon", 1), ("hidden-1.near", 3), ("hidden-1.soon", 1),
    ]  # fmt: skip
    assert [finding.title for finding in verdict.findings][2] == "hidden case 1: the last guess"


def test_a_trial_that_failed_in_a_part_earns_the_others(grade: Callable[[str], Verdict]) -> None:
    late = RIGHT.replace(
        "ends[hint", "pass\n    calls[0] += 1\n    if hint != 'begin' and calls[0] > 9:\n        ends[hint"
    )
    late = late.replace("ends = [0.0, 1.0]\n\ndef", "ends, calls = [0.0, 1.0], [0]\n\ndef")
    late = late.replace('if hint == "begin":', 'if hint == "begin":\n        calls[0] = 0')
    verdict = grade(late)
    assert verdict.status is Status.PARTIAL, verdict.diagnosis
    assert verdict.points == 6
    assert verdict.diagnosis == "seen: Not soon enough."


def test_what_raises_in_every_trial_is_crashed(grade: Callable[[str], Verdict]) -> None:
    verdict = grade("def guess(hint):\n    return 1 / 0\n")
    assert (verdict.status, verdict.points) == (Status.CRASHED, 0)
    assert "ZeroDivisionError" in (verdict.diagnosis or "")


def test_a_missing_function_is_named(grade: Callable[[str], Verdict]) -> None:
    verdict = grade("def gues(hint):\n    return 0.5\n")
    assert verdict.status is Status.CRASHED
    assert "guess" in (verdict.diagnosis or "")


def test_a_trial_has_its_own_limit(grade: Callable[[str], Verdict]) -> None:
    verdict = grade("def guess(hint):\n    while True: pass\n")
    assert verdict.status is Status.TIMED_OUT
    assert "one case" in (verdict.diagnosis or "") and "in seen." in (verdict.diagnosis or "")
