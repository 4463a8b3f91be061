"""The `policy` kind runs a network of a declared form, whose weights a learner hands in, over drawn episodes. The file
is read in the jail; only its numbers come out."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from inspect import getsource
from typing import Any

import numpy as np

from grader.domain.axes import Placed
from grader.exercises.episodes.environment import NO_ENVIRONMENT, Environment
from grader.exercises.episodes.films import record_films
from grader.exercises.episodes.judge import bound_luck
from grader.exercises.episodes.parameters import EpisodesCase, Problem, check_names, pose_case
from grader.exercises.episodes.pictures import build_evidence
from grader.exercises.episodes.placing import place_episodes
from grader.exercises.episodes.simulating import EpisodeRun, Record, list_constant_laws, simulate_law
from grader.exercises.film import Film
from grader.exercises.kind import Content, DrawnCase, JudgedTrial, Judgement, Kind, Results, Trial
from grader.exercises.kinds.policy import driver, onnx
from grader.exercises.kinds.policy.judge import SimulatedPolicy, judge_policy, list_shapes
from grader.exercises.kinds.policy.mistakes import name_the_mistake
from grader.exercises.kinds.policy.network import write_constant
from grader.exercises.kinds.policy.parameters import NUMBERS_MAX, PolicyParameters, count_numbers
from grader.exercises.kinds.policy.variants import list_columns
from grader.exercises.parameters import WrongParameter
from grader.exercises.programs import load_program
from grader.questions.kinds.script import ScriptQuestion

NOT_REPEATED = (
    "the same episode runs otherwise each time: draw from the `rng` of `reset` alone, and keep nothing between calls"
)

PERIODS_REHEARSED = 20
BEYOND = 1e6
"""An output that is beyond every actuator."""


class Policy(Kind[PolicyParameters, Problem, Any]):
    """Judges the weights of a policy: one trial for each case, of one or more episodes."""

    parameters = PolicyParameters
    driver = getsource(onnx) + getsource(driver)
    takes = ("npz",)
    mistakes_tell_size = False
    how = "The grader reads the arrays of your file, runs the policy in its own simulation, and judges the motion."

    def build_trials(self, parameters: PolicyParameters, drawn: DrawnCase[EpisodesCase]) -> Sequence[Trial[Problem]]:
        """Returns one trial, whose inputs are the declared form and no number of the case."""
        problem = pose_case(parameters, drawn, load_environment(parameters, drawn.content))
        check_names(parameters, problem)
        with blame_program(parameters):
            width = len(EpisodeRun(parameters, problem, 0).observe().observed)
        shapes = parameters.form.list_shapes(width, problem.model.nu)
        if count_numbers(shapes) > NUMBERS_MAX:
            raise WrongParameter("form", f"has {count_numbers(shapes)} numbers; at most {NUMBERS_MAX} fit into a file")
        inputs = {
            "arrays": {name: list(shape) for name, shape in shapes.items()},
            "width": width,
            "functions": parameters.form.list_functions(),
            "observed": list_columns(parameters, problem)[:width],
        }
        return [Trial(drawn.case.id, inputs, problem)]

    def rehearse(self, parameters: PolicyParameters, trial: Trial[Problem]) -> None:
        """Simulates the first periods of the case without control. Raises ValueError and KeyError."""
        problem, width = trial.problem, trial.inputs["width"]
        if parameters.form.scales and not problem.model.actuator_ctrllimited.all():
            raise WrongParameter("form.actions", "the outputs are shares of ranges, and an actuator has no ctrlrange")
        known = parameters.normalisation
        if known is not None and not len(known.mean) == len(known.std) == width:
            raise WrongParameter("normalisation", f"needs {width} numbers each, one for each observation")
        _, law = list_constant_laws(problem, has_target=False)[0]
        periods = min(PERIODS_REHEARSED, problem.periods)
        with blame_program(parameters):
            record, again = (simulate_law(parameters, problem, 0, law, periods) for _ in range(2))
            if not is_repeated(record, again):
                raise ValueError(NOT_REPEATED)
        if record.lost_at_s is not None:
            raise ValueError("the simulation blows up without any control: take a shorter timestep")

    def judge(self, parameters: PolicyParameters, trial: Trial[Problem], results: Results) -> Judgement[Any]:
        """Runs the policy, and measures each goal or counts the episodes that reach all."""
        return judge_policy(parameters, trial, results)

    def name_mistake(self, parameters: PolicyParameters, judged: Sequence[JudgedTrial[Problem, Any]]) -> str | None:
        """Returns the sentence of the first mistake that explains what failed."""
        return name_the_mistake(parameters, judged)

    def build_pictures(
        self, parameters: PolicyParameters, visible: Sequence[JudgedTrial[Problem, Any]]
    ) -> dict[str, Any]:
        """Returns charts of the motion and of the controls."""
        return build_evidence(
            parameters, [trial for trial in visible if isinstance(trial.judgement.outcome, SimulatedPolicy)]
        )

    def record_films(
        self, parameters: PolicyParameters, trials: Sequence[Trial[Problem]], evidence: Mapping[str, Any],
        failed: Collection[str], *, timestep_s: float | None = None,
    ) -> Sequence[Film]:  # fmt: skip
        """Returns the run that the evidence keeps."""
        return record_films(trials, evidence)

    def place_on_axes(self, parameters: PolicyParameters, verdict: Mapping[str, Any]) -> Iterable[Placed]:
        """Returns what each goal measured, beside what is allowed."""
        return place_episodes(parameters, verdict)

    def write_lazy_answers(
        self, question: ScriptQuestion, parameters: PolicyParameters, trials: Sequence[Trial[Problem]]
    ) -> Mapping[str, str]:
        """Returns policies that look at nothing."""
        outputs = {"all weights 0": 0.0, "always the highest control": BEYOND, "always the lowest control": -BEYOND}
        shapes = list_shapes(trials[0])
        return {name: write_constant(parameters.form, shapes, output) for name, output in outputs.items()}

    def bound_luck(self, parameters: PolicyParameters, trials: Sequence[Trial[Problem]]) -> float | None:
        """Returns 1 if a law that looks at nothing passes one of the episodes, and 0 if none does."""
        (trial,) = trials
        return bound_luck(parameters, trial.problem)


def is_repeated(record: Record, again: Record) -> bool:
    """Whether an episode is the same in every bit when it is simulated again."""
    return record.is_over == again.is_over and all(
        np.array_equal(getattr(record, name), getattr(again, name), equal_nan=True)
        for name in ("time_s", "qpos", "observed", "rewards")
    )


@contextmanager
def blame_program(parameters: PolicyParameters) -> Iterator[None]:
    """Raises WrongParameter for what the author's program raises."""
    try:
        yield
    except Exception as error:
        if parameters.program is None:
            raise
        raise WrongParameter("program", f"{parameters.program}: {type(error).__name__}: {error}") from error


def load_environment(parameters: PolicyParameters, content: Content) -> Environment:
    """Returns the functions of the author's program. Raises WrongParameter."""
    environment = NO_ENVIRONMENT
    if parameters.program is not None:
        program = load_program(parameters.program, content.text_of, "program")
        try:
            environment = Environment.from_program(program)
        except ValueError as error:
            raise WrongParameter("program", f"{parameters.program}: {error}") from error
    if bool(parameters.observe) == (environment.observe is not None):
        why = (
            "give sensors, or a `program` with a function observe"
            if not parameters.observe
            else ("is for exercises whose `program` defines no function observe")
        )
        raise WrongParameter("observe", why)
    return environment
