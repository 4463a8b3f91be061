"""What a kind of exercise provides, and the values that pass between a kind and the runner."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from grader.domain.quiz import CodeQuestion, ModelXml
from grader.exercises.parameters import Case, ExerciseParameters

TextOf = Callable[[str], str]
"""Returns the text of a file of the content folder by its path in it; raises GraderError if it cannot be read."""

Results = Mapping[str, NDArray[np.generic]]
"""The arrays that a driver submitted in one trial, by name. They are claims of the student's process."""

Intervals = Sequence[tuple[float, float]]
"""Intervals (lowest, highest) within which the numbers of one answer are accepted; (inf, inf) stands for None."""

P = TypeVar("P", bound=ExerciseParameters)
Problem = TypeVar("Problem")
Outcome = TypeVar("Outcome")


@dataclass(frozen=True)
class Content:
    """What a kind may read beside its parameters: the question's `entry`, models and files of the content folder."""

    entry: str
    model_xml: ModelXml
    text_of: TextOf


@dataclass(frozen=True)
class DrawnCase:
    """A case whose numbers are drawn: `xml` is its MJCF with them, `xml_as_written` without; both None without a model.

    `rng` is seeded by [seed, index of the case] and has drawn the numbers already; a kind may draw more from it.
    """

    case: Case
    numbers: Mapping[str, float]
    xml: str | None
    xml_as_written: str | None
    rng: np.random.Generator
    content: Content


@dataclass(frozen=True)
class Trial(Generic[Problem]):
    """One run of the kind's driver in the jail, which gives one finding.

    `inputs` is plain JSON for the driver; `problem` is what only the judge knows. A trial without a `case` concerns the
    exercise as a whole. `title` follows the case's title; it is public also where the trial is hidden. `points` are
    shares. `entries` names the student's functions that the driver gets; empty means the question's `entry`.
    """

    id: str
    inputs: Mapping[str, Any]
    problem: Problem
    case: Case | None = None
    title: str = ""
    hidden: bool = False
    points: float = 1.0
    entries: tuple[str, ...] = ()


@dataclass(frozen=True)
class Judgement(Generic[Outcome]):
    """What a kind finds out about one trial.

    `message` is a sentence that holds no number of the case, of the student's result, or of the expected one. `detail`
    is another that may; like `measured` and `expected` it is left out of hidden trials. `outcome` is the kind's own,
    for its mistakes and pictures.

    A trial that passed counts only if one of the trials in `needs` (ids) passed without a need of its own; otherwise
    its message is `unmet`. `review`, where not empty, is a sentence that asks for a person's decision.
    """

    passed: bool
    message: str
    outcome: Outcome
    detail: str = ""
    measured: Any = None
    expected: Any = None
    needs: tuple[str, ...] = ()
    unmet: str = ""
    review: str = ""


@dataclass(frozen=True, eq=False)
class Judged(Generic[Problem, Outcome]):
    """A trial with its judgement. `counts`: it passed, and what it needs passed too."""

    trial: Trial[Problem]
    judgement: Judgement[Outcome]
    counts: bool


@dataclass(frozen=True)
class LazyAnswer:
    """A script that does not solve the exercise, and the points [of the question's] that it may earn at most."""

    name: str
    source: str
    points_max: float


class Kind(ABC, Generic[P, Problem, Outcome]):
    """A kind of exercise: found by its name through the entry-point group `grader.exercise_kinds`.

    `driver` is Python source that runs in the jail. It defines `trial(functions, inputs, submit)`: call the student's
    functions and submit named arrays of numbers. It may define `before_import()`, called before the student's module is
    imported. What it raises in a trial counts as raised by the student.
    """

    parameters: type[P]
    driver: str
    without_integrators: bool = False
    """Whether MuJoCo's integrators are removed before the functions are called; calling one is then forbidden."""
    needs_model: bool = True
    """Whether a case without a model is a fault."""

    @abstractmethod
    def trials(self, parameters: P, drawn: DrawnCase) -> Sequence[Trial[Problem]]:
        """Returns the trials of one case. Raises WrongParameter, or ValueError or KeyError for faults of the case."""

    def further_trials(self, parameters: P, trials: Sequence[Trial[Problem]]) -> Sequence[Trial[Problem]]:
        """Returns trials of the exercise as a whole; `trials` are those of the cases."""
        return ()

    def rehearse(self, parameters: P, trial: Trial[Problem]) -> None:
        """Raises ValueError if the trial could not be judged; called when content is loaded."""
        return

    @abstractmethod
    def judge(self, parameters: P, trial: Trial[Problem], results: Results) -> Judgement[Outcome]:
        """Judges what the driver submitted in one trial; must not raise, whatever `results` holds."""

    def mistake(self, parameters: P, judged: Sequence[Judged[Problem, Outcome]]) -> str | None:
        """Names the mistake behind the trials that failed, without numbers of hidden cases; None if none is recognised.

        `judged` leaves out the trials that raised.
        """
        return None

    def pictures(self, parameters: P, visible: Sequence[Judged[Problem, Outcome]]) -> dict[str, Any]:
        """Returns the verdict's evidence as plain JSON."""
        return {}

    def lazy_answers(
        self, question: CodeQuestion, parameters: P, trials: Sequence[Trial[Problem]]
    ) -> Mapping[str, str]:
        """Returns scripts by name that answer every model alike; they may earn the points of the visible trials."""
        return {}

    def accepted(self, parameters: P, trials: Sequence[Trial[Problem]]) -> Sequence[Intervals] | None:
        """Returns the intervals of right answers to the trials of one case, for the chance of a fixed answer.

        Each item holds the intervals that one draw decides together; the items are drawn independently. None means
        that no answer that ignores its inputs is judged by intervals.
        """
        return None
