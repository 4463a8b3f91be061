"""The `estimator` kind: the function gets noisy recordings of a model, and estimates numbers of it.

A kind that plays: one trial has many recordings, the function is asked for each, and every number is a finding of its
own, with the share of recordings in which it is found.
"""

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from grader.exercises import (
    Ask,
    Case,
    DrawnCase,
    ExerciseParameters,
    JudgedTrial,
    Judgement,
    Kind,
    MalformedAnswer,
    Part,
    Positive,
    Range,
    Trial,
    TrialProgress,
    bound_share,
)

DRIVER = '''
import struct

import numpy as np


def trial(functions, inputs, submit):
    """A message is a recording: float64 times, then positions. An answer is the estimates, or "X" and an exception."""
    (entry,) = functions
    message = exchange(None)
    while message is not None:
        try:
            times, positions = np.frombuffer(message, "<f8").reshape(2, -1).copy()
            returned = entry(load_model(inputs["model"]), times, positions)
            estimates = [float(returned[name]) for name in inputs["names"]]
            if not np.isfinite(estimates).all():
                raise ValueError("an estimate is not finite (nan or inf)")
            answer = b"E" + struct.pack(f"<{len(estimates)}d", *estimates)
        except Exception as error:
            answer = b"X" + explain(error)
        message = exchange(answer)
'''

Floats = NDArray[np.float64]
FACTORS = {0.5: "half of", 2.0: "twice", 0.25: "a quarter of", 4.0: "four times"}
FACTOR_RTOL = 0.1


class EstimatorCase(Case):
    """How many recordings there are, and the share of them in which each number must be found."""

    recordings: int = Field(default=10, ge=1, le=50)
    share: float = Field(default=0.9, gt=0, le=1)


class EstimatorParameters(ExerciseParameters):
    """`estimate` names the `numbers` that are estimated, to `rtol` of each. A recording is the first joint position
    from `start` on, each `period_s` for `seconds`, with `noise` as its standard deviation."""

    estimate: tuple[str, ...] = Field(min_length=1, max_length=5)
    rtol: Positive = 0.1
    start: Range
    noise: Positive
    period_s: Positive
    seconds: Positive = Field(le=20)
    cases: tuple[EstimatorCase, ...]

    @model_validator(mode="after")
    def _check(self) -> Self:
        for case in self.cases:
            if missing := {*self.estimate} - {*case.set}:
                raise ValueError(f"the case {case.id} sets no {min(missing)}, which is to be estimated")
        return self


@dataclass(frozen=True, eq=False)
class Problem:
    """What is recorded: the true numbers in their order, times (n,) [s], and positions (recordings, n)."""

    case: EstimatorCase
    truth: Floats
    times: Floats
    positions: Floats


Answers = list[Floats | str]
"""For each recording the estimates, or the exception."""


class Estimator(Kind[EstimatorParameters, Problem, Answers]):
    """Judges numbers that are estimated from recordings."""

    parameters = EstimatorParameters
    driver = DRIVER
    plays = True
    how = "The grader records the model with noise, and calls your function with each recording."

    def build_trials(
        self, parameters: EstimatorParameters, drawn: DrawnCase[EstimatorCase]
    ) -> Sequence[Trial[Problem]]:
        """Returns one trial, whose inputs have the model as it was written."""
        model = mujoco.MjModel.from_xml_string(drawn.xml)
        times, positions = record(parameters, drawn.case.recordings, model, drawn.rng)
        truth = np.array([drawn.numbers[name] for name in parameters.estimate])
        inputs = {"model": drawn.xml_as_written, "names": list(parameters.estimate)}
        return [Trial(drawn.case.id, inputs, Problem(drawn.case, truth, times, positions), cpu_s=5)]

    def play(self, parameters: EstimatorParameters, trial: Trial[Problem], ask: Ask) -> Answers:
        """Asks for the estimates of each recording."""
        answers: Answers = []
        count = len(trial.problem.positions)
        for index, positions in enumerate(trial.problem.positions):
            ask.tell(TrialProgress(index + 1, count, "episode"))
            answers.append(read_answer(ask(np.array([trial.problem.times, positions], "<f8").tobytes()), parameters))
        return answers

    def judge(self, parameters: EstimatorParameters, trial: Trial[Problem], results: Any) -> Judgement[Answers]:
        """Returns a finding for each number."""
        answers: Answers = results
        faults = [one for one in answers if isinstance(one, str)]
        parts = tuple(judge_number(parameters, trial.problem, answers, i) for i in range(len(parameters.estimate)))
        failed = [part for part in parts if not part.passed]
        message = failed[0].message if failed else "Every number is found."
        crashed = len(faults) == len(answers)
        if faults and failed:
            message = f"{faults[0]}." if not trial.hidden else "Your function raised in some recordings."
        return Judgement(not failed, message, answers, parts=() if crashed else parts, crashed=crashed)

    def name_mistake(
        self, parameters: EstimatorParameters, judged: Sequence[JudgedTrial[Problem, Answers]]
    ) -> str | None:
        """Recognises a number that is always off by the same factor."""
        wrong = [trial for trial in judged if not trial.judgement.passed]
        for index, name in enumerate(parameters.estimate):
            ratios = [list_ratios(trial, index) for trial in wrong]
            for factor, words in FACTORS.items():
                if wrong and all(len(some) and abs(np.median(some) / factor - 1) < FACTOR_RTOL for some in ratios):
                    return f"Your {name} is {words} the true one: look for a factor in its formula."
        return None

    def build_pictures(
        self, parameters: EstimatorParameters, visible: Sequence[JudgedTrial[Problem, Answers]]
    ) -> dict[str, Any]:
        """Returns the first recording of each case, and a table of the estimates."""
        tables = [list_estimates(parameters, trial) for trial in visible]
        return {"charts": [draw_recording(trial) for trial in visible], "tables": tables}

    def write_lazy_answers(self, question: Any, parameters: EstimatorParameters, trials: Any) -> Mapping[str, str]:
        """Returns a script that answers the numbers of the visible case."""
        first = dict(zip(parameters.estimate, trials[0].problem.truth.tolist(), strict=True))
        returns = f"def {question.entry}(model, times, positions):\n    return {first}\n"
        return {"the numbers of the first case": returns}

    def list_accepted(self, parameters: EstimatorParameters, trials: Sequence[Trial[Problem]]) -> Any:
        """Returns the intervals of right numbers."""
        (trial,) = trials
        off = parameters.rtol * np.abs(trial.problem.truth)
        return [[(low, high)] for low, high in zip(trial.problem.truth - off, trial.problem.truth + off, strict=True)]


def record(
    parameters: EstimatorParameters, count: int, model: mujoco.MjModel, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Returns the times (n,) and positions (count, n) of noisy runs."""
    steps, samples = round(parameters.period_s / model.opt.timestep), round(parameters.seconds / parameters.period_s)
    positions = np.empty((count, samples))
    for row in positions:
        data = mujoco.MjData(model)
        position = data.qpos
        position[0] = rng.uniform(*parameters.start)
        for i in range(samples):
            row[i] = position[0]
            mujoco.mj_step(model, data, steps)
    positions += rng.normal(0, parameters.noise, positions.shape)
    return np.arange(samples) * steps * model.opt.timestep, positions


def read_answer(answer: bytes, parameters: EstimatorParameters) -> Floats | str:
    """Returns the estimates, or the exception. Raises MalformedAnswer for what the driver does not send."""
    count = len(parameters.estimate)
    if answer[:1] == b"E" and len(answer) == 1 + 8 * count:
        estimates = np.array(struct.unpack(f"<{count}d", answer[1:]))
        if np.isfinite(estimates).all():
            return estimates
    if answer[:1] == b"X":
        try:
            return str(json.loads(answer[1:])["raised"])[:300]
        except (ValueError, KeyError, TypeError, RecursionError):
            pass
    raise MalformedAnswer


def judge_number(parameters: EstimatorParameters, problem: Problem, answers: Answers, index: int) -> Part:
    """Returns the finding of one number: the share of recordings in which it is found."""
    name, truth, n = parameters.estimate[index], problem.truth[index], len(answers)
    estimates = [array[index] for array in answers if not isinstance(array, str)]
    count = sum(bool(abs(one - truth) <= parameters.rtol * abs(truth)) for one in estimates)
    low, high = bound_share(count, n)
    passed = count >= problem.case.share * n - 1e-9
    message = f"The {name} is found." if passed else f"The {name} is found in too few recordings."
    interval = f"95 % interval: {100 * low:.0f} to {100 * high:.0f} %"
    detail = f"Found in {count} of {n} recordings ({interval}); {100 * problem.case.share:g} % must."
    return Part(name, name, passed, message, detail, measured=count / n, expected=problem.case.share)


def list_ratios(trial: JudgedTrial[Problem, Answers], index: int) -> list[float]:
    """Returns how many times the true number each estimate is."""
    truth = float(trial.problem.truth[index])
    return [float(answer[index]) / truth for answer in trial.judgement.outcome if not isinstance(answer, str)]


def draw_recording(trial: JudgedTrial[Problem, Answers]) -> dict[str, Any]:
    """Returns the chart of the first recording."""
    problem = trial.problem
    series = {"label": "recorded", "x": problem.times.tolist(), "y": problem.positions[0].tolist(), "points": True}
    axes = {"x": {"label": "time (s)"}, "y": {"label": "position"}}
    return {"case": trial.id, "title": "the first recording", **axes, "series": [series]}


def list_estimates(parameters: EstimatorParameters, trial: JudgedTrial[Problem, Answers]) -> dict[str, Any]:
    """Returns a table of the estimates, the true numbers last."""
    rows = [
        [str(i), *([answer] * len(parameters.estimate) if isinstance(answer, str) else [f"{x:.4g}" for x in answer])]
        for i, answer in enumerate(trial.judgement.outcome, 1)
    ]
    rows.append(["true", *(f"{x:.4g}" for x in trial.problem.truth)])
    return {"case": trial.id, "title": "estimates", "head": ["recording", *parameters.estimate], "rows": rows}
