"""Judges a policy: reads what the driver submitted, and runs it over the episodes of a case."""

from dataclasses import dataclass, replace
from typing import Any

from grader.exercises.episodes.judge import EpisodeOutcome, judge_records
from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import simulate_law
from grader.exercises.judgement import Judgement, Results
from grader.exercises.kind import Trial
from grader.exercises.kinds.policy.network import Network, read_network
from grader.exercises.kinds.policy.parameters import PolicyParameters, Shapes

NOTHING_READ = "Nothing could be read from the file."
REFUSAL_CHARS_MAX = 500


@dataclass(frozen=True)
class SimulatedPolicy(EpisodeOutcome):
    """The records of a policy, and the network."""

    network: Network


@dataclass(frozen=True)
class RefusedFile:
    """A file that holds no policy of the declared form, and why."""

    why: str


def list_shapes(trial: Trial[Problem]) -> Shapes:
    """Returns the declared shape of each array."""
    return {name: tuple(shape) for name, shape in trial.inputs["arrays"].items()}


def judge_policy(parameters: PolicyParameters, trial: Trial[Problem], results: Results) -> Judgement[Any]:
    """Returns the judgement on a case: its outcome is Ran or Refused."""
    problem = trial.problem
    network = read_network(parameters.form, list_shapes(trial), problem.model, results)
    if network is None:
        why = read_refusal(results)
        return Judgement(
            False, why, RefusedFile(why), crashed="unreadable" in results and bool(results["unreadable"].any())
        )

    def law(time_s: float, observed: Any) -> Any:
        return network.act(observed)

    indices = range(len(problem.episodes))
    records = [simulate_law(parameters, problem, index, law, problem.periods) for index in indices]
    judgement = judge_records(parameters, problem, records, hidden=trial.hidden)
    outcome = judgement.outcome
    return replace(judgement, outcome=SimulatedPolicy(outcome.records, outcome.failed, network))


def read_refusal(results: Results) -> str:
    """Returns the driver's sentence on a file that it could not read."""
    refusal = results.get("refused")
    if refusal is None or refusal.dtype.kind != "u" or refusal.size > REFUSAL_CHARS_MAX:
        return NOTHING_READ
    text = refusal.tobytes().decode("utf-8", "replace")
    return text if text.isprintable() and text.strip() else NOTHING_READ
