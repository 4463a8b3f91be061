"""Defines a kind of exercise, and the values that pass between a kind and the runner."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

import mujoco
import numpy as np

from grader.domain.axes import Placed
from grader.domain.progress import TrialProgress
from grader.domain.run import Job, Limits, RunReport
from grader.exercises.explaining.claims import SentenceClaim
from grader.exercises.explaining.places import Landmark
from grader.exercises.explaining.script import NO_SCRIPT, ParsedScript
from grader.exercises.film import Film
from grader.exercises.judgement import Judgement, Outcome, Part, Results
from grader.exercises.parameters import Case, ExerciseParameters
from grader.exercises.trace import NO_TRACE, Trace
from grader.questions import ModelXml, Reveal, Takes
from grader.questions.kinds.script import ScriptQuestion

__all__ = [
    "Ask", "Content", "DrawnCase", "ExerciseExample", "Intervals", "JudgedTrial", "Judgement", "Kind", "LazyAnswer",
    "Measurement", "Mistake", "Part", "Results", "TextOf", "Trial",
]  # fmt: skip


class Ask(Protocol):
    """Asks the kind's driver, which is in a trial."""

    def __call__(self, message: bytes, /) -> bytes:
        """Sends a message and returns the answer: a claim of the script's process. Raises ChannelClosed once the script
        has ended."""

    def tell(self, progress: TrialProgress, /) -> None:
        """Tells the learner how far a trial is that takes long; nothing of a hidden one. Costs 20 us: tell it for each
        episode or second of a simulation, not for each step."""


TextOf = Callable[[str], str]
"""Returns the text of a file of the content folder by its path in it; raises GraderError if it cannot be read."""

Intervals = Sequence[tuple[float, float]]
"""Intervals (lowest, highest) of accepted numbers, one for each number of an answer; (inf, inf) means None."""

CPU_S_MAX = 120.0
"""CPU time of all measurements of a script together [s]: far less than a verdict may take."""

ALIKE = 0.005
"""Numbers that differ by no more, relative to the larger, come from the same mistake: what is measured has three
figures."""

P = TypeVar("P", bound=ExerciseParameters)
C = TypeVar("C", bound=Case)
Problem = TypeVar("Problem")


@dataclass(frozen=True)
class Content:
    """The question's `entry`, the models and files of the content folder, which a kind may read, and what the question
    `takes`. `is_fixed`: the numbers are drawn as whenever this content is loaded, so what is made of them is needed
    again."""

    entry: str
    model_xml: ModelXml
    text_of: TextOf
    takes: Takes = "python"
    is_fixed: bool = False


@dataclass(frozen=True)
class DrawnCase(Generic[C]):
    """A case whose numbers are drawn. `xml` is the MJCF of its model with the drawn numbers, `xml_as_written` without
    them. Both are empty where the case has no model, which only a kind with `needs_model = False` allows. `rng` is
    seeded by [seed, index of the case] and has drawn the numbers already; a kind draws everything else from it."""

    case: C
    numbers: Mapping[str, float]
    xml: str
    xml_as_written: str
    rng: np.random.Generator
    content: Content


@dataclass(frozen=True)
class Trial(Generic[Problem]):
    """One run of the kind's driver in the jail, which gives one finding.

    `id` is unique in the exercise, and students see it. `inputs` is plain JSON for the driver (lists, no arrays);
    `problem` is what only the judge knows. `title` follows the case's title; it is public also where the trial is
    hidden. `points` are shares of the case's points. `entries` names the student's functions that the driver gets;
    empty means the question's `entry`. `cpu_s` is the CPU time that the script may take in the trial [s], of a kind
    that plays; a script that takes more is ended. `measured` are the inputs of the measuring program, where they hold
    what the script may not know; None: `inputs`.

    The runner sets `case`, and hides the trials of a hidden case. A trial of `build_further_trials` has no case: it
    sets `hidden` itself, and its `points` are shares of the question's.
    """

    id: str
    inputs: Mapping[str, Any]
    problem: Problem
    title: str = ""
    points: float = 1.0
    entries: tuple[str, ...] = ()
    hidden: bool = False
    case: Case | None = None
    cpu_s: float | None = None
    measured: Mapping[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class JudgedTrial(Generic[Problem, Outcome]):
    """A trial with its judgement. `counts` says whether it passed, and a trial that it needs passed too. `trace` is
    what the script did in the trial, as it claims, and `script` its text: both explain, and never decide."""

    trial: Trial[Problem]
    judgement: Judgement[Outcome]
    counts: bool
    trace: Trace = NO_TRACE
    script: ParsedScript = NO_SCRIPT

    @property
    def id(self) -> str:
        """The id of the trial."""
        return self.trial.id

    @property
    def problem(self) -> Problem:
        """The problem of the trial."""
        return self.trial.problem

    @property
    def hidden(self) -> bool:
        """Whether the case of the trial is hidden."""
        return self.trial.hidden


@dataclass(frozen=True)
class Mistake:
    """What is wrong with a script: a sentence for the student, and the line of the script that it is about, from 1."""

    sentence: str
    line: int | None = None


@dataclass(frozen=True)
class LazyAnswer:
    """A script that does not solve the exercise, and the most points that it may earn, of those of the question. It may
    earn no more than the script of the name `like` does, if an earlier one has it."""

    name: str
    source: str
    points_max: float
    like: str = ""


@dataclass(frozen=True)
class Measurement:
    """A program that compiles and simulates what a script made, in a process of the jail of its own for each trial. It
    is Python source like a driver's, and defines `measure(inputs, results, submit)`: the trial's `inputs`, and the
    arrays that the driver submitted. `judge` gets the arrays that it submits in their place. If it raises, or reaches
    one of its limits, the trial is failed with a sentence that says which, and `judge` is not called. No further trial
    is measured once all of a script have taken `cpu_s_all` [s]."""

    program: str
    limits: Limits = field(default_factory=lambda: Limits(cpu_s=2, wall_s=20))
    cpu_s_all: float = CPU_S_MAX


@dataclass(frozen=True)
class ExerciseExample:
    """A question as its author writes it, without `id` and `kind`; a program that is right, and the other files of the
    content folder that it needs, by path: models, a starter."""

    question: Mapping[str, Any]
    right: str
    files: Mapping[str, str] = field(default_factory=dict)


def agree(one: Any, other: Any) -> bool:
    """Whether two values of plain JSON agree: numbers to ALIKE of their size, everything else exactly."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(agree(value, other[name]) for name, value in one.items())
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(agree, one, other))
    if isinstance(one, int | float) and isinstance(other, int | float):
        return one == other or abs(one - other) <= ALIKE * max(abs(one), abs(other))
    return bool(one == other)


class Kind(ABC, Generic[P, Problem, Outcome]):
    """A kind of exercise: found by its name through the entry-point group `grader.exercise_kinds`. A kind must define
    `parameters`, `driver`, `build_trials` and `judge`; the rest has defaults.

    `driver` is Python source that runs in the jail, where only the standard library, NumPy, SciPy and MuJoCo can be
    imported. It defines `trial(functions, inputs, submit)`: call the student's functions and submit named arrays of
    finite numbers. It may define `before_import()`, called before the student's module is imported, and finds
    `load_model(xml)` among its names, which returns a new model of an MJCF text. What it raises in a trial counts
    as raised by the student, and so does a result that is not finite; unless it raises as well for a script whose
    functions only raise, which is a fault of the kind. It finds `note(name, info, numbers)` among
    its names, which adds to the trial's trace; see grader.exercises.driving.recorder."""

    parameters: type[P]
    driver: str
    takes: Sequence[Takes] = ("python",)
    """What may be handed in. For MJCF text and for a file the student's function, which the grader writes, takes any
    arguments and returns the text, or the bytes of the file: a stranger's, of up to 256 KB, for `npz` as numpy.savez
    or as ONNX writes it."""
    measurement: Measurement | None = None
    """What is needed where a script makes models, or anything else that takes time or files to judge: never compile or
    simulate it in `judge`, which runs in the grader's own process."""
    without_integrators: bool = False
    """Whether MuJoCo's integrators are removed before the functions are called; calling one is then forbidden."""
    how: str = ""
    """How a visible case is judged, in a sentence or two for learners."""
    plays: bool = False
    """Whether `play` runs each trial in the grader's own process, and asks the driver step by step. `judge` gets what
    it returns in place of results."""
    needs_model: bool = True
    """Whether a case without a model is a fault."""
    claims: Sequence[SentenceClaim] = ()
    """What the sentences of `name_mistake` claim, beside what those of any kind may, and when it is true."""
    landmarks: Sequence[Landmark] = ()
    """How to find the line of a script that a sentence of `name_mistake` is about which has none."""
    runs_wrong_programs: bool = False
    """Whether `name_mistake` compares with the programs of the author's `mistakes` itself. Else each runs in the jail
    like a student's script, and `is_alike` compares."""
    mistakes_tell_size: bool = True
    """Whether a sentence of `name_mistake` may tell how far a result is off, which leads to the expected one: twice, in
    degrees. Where the author reveals the direction alone, such a sentence is not shown."""

    def example(self) -> ExerciseExample | None:
        """Returns an exercise that passes `grader check`: what `grader new exercise` and the desk begin. None: no
        example."""
        return None

    @abstractmethod
    def build_trials(self, parameters: P, drawn: DrawnCase[Any]) -> Sequence[Trial[Problem]]:
        """Returns the trials of one case. Raises WrongParameter, or ValueError or KeyError for faults of the case."""

    def build_further_trials(self, parameters: P, trials: Sequence[Trial[Problem]]) -> Sequence[Trial[Problem]]:
        """Returns trials of the exercise as a whole; `trials` are those of the cases."""
        return ()

    def rehearse(self, parameters: P, trial: Trial[Problem]) -> None:
        """Raises ValueError if the trial cannot be judged; called when content is loaded."""
        self.prepare(parameters, trial)

    def certify(self, parameters: P, trial: Trial[Problem]) -> None:
        """Raises ValueError if what the trial is compared with is not certain; called by `grader check`, which may take
        longer than loading content."""
        return

    def prepare(self, parameters: P, trial: Trial[Problem]) -> None:
        """Computes and caches what `judge` needs of the trial whatever the script does; called while it runs. Raises
        only what `rehearse` has raised before."""
        return

    def compile_model(self, parameters: P, trial: Trial[Problem]) -> mujoco.MjModel | None:
        """Returns the compiled model of the MJCF text `trial.inputs["model"]`, where judging needs it as well, and
        caches it: the jail loads it in a third of the time that compiling takes. None: the jail compiles the text."""
        return None

    def play(self, parameters: P, trial: Trial[Problem], ask: Ask) -> Any:
        """Simulates a trial of a kind that `plays`, and asks the driver for what the student's function returns. The
        driver's `trial` answers `exchange`'s messages one by one, until that returns None. Raises MalformedAnswer where
        an answer is none that the driver sends, which ends the script; and lets ChannelClosed pass, with a note that
        says where it was (`add_note`), for the learner: it is dropped where the trial is hidden."""
        raise NotImplementedError

    @abstractmethod
    def judge(self, parameters: P, trial: Trial[Problem], results: Results) -> Judgement[Outcome]:
        """Judges what the driver submitted in one trial; must not raise, whatever `results` holds. The student's
        process may have forged the results: check names, shapes and types. Floats are finite. The trace is left out."""

    def describe_inputs(self, trial: Trial[Problem]) -> Mapping[str, Any]:
        """Returns the inputs of a visible trial for the learner's own machine, where nothing is traced."""
        return trial.inputs

    def describe_problem(self, reveal: Reveal | None, parameters: P, trial: Trial[Problem]) -> Mapping[str, Any] | None:
        """Returns as plain JSON what judges a visible trial on the learner's own machine: nothing that the feedback on
        a wrong answer would not tell with this `reveal` of the author's. None where only the server judges."""
        return None

    def name_mistake(self, parameters: P, judged: Sequence[JudgedTrial[Problem, Outcome]]) -> Mistake | str | None:
        """Returns a sentence for the mistake behind the failed trials, without numbers of hidden cases, or None. A
        `Mistake` has the line that the sentence is about, too.
        `judged` leaves out the trials in which the script raised, but not those whose results `judge` could not read.
        Like `judge`, `name_mistake` and `build_pictures` must not raise."""
        return None

    def name_mistake_by_runs(
        self, parameters: P, judged: Sequence[JudgedTrial[Problem, Outcome]], run: Callable[[Job], RunReport]
    ) -> Mistake | str | None:
        """Returns what `name_mistake` does, where that returns None: by programs that `run` runs in the jail, within a
        counted number of steps, so that load changes no verdict. Raises JailFault, and nothing else."""
        return None

    def write_wrong_script(self, parameters: P, index: int, text_of: TextOf) -> str:
        """Returns a script with one of the author's `mistakes`, for `grader check`. Raises GraderError."""
        return text_of(parameters.mistakes[index].program)

    def is_alike(
        self, parameters: P, trial: Trial[Problem], one: Judgement[Outcome], other: Judgement[Outcome]
    ) -> bool:
        """Whether two scripts that failed a trial did the same in it: by default, where what was `measured` of them and
        of their parts agrees. A kind that measures nothing in a hidden trial compares the outcomes."""
        mine, its = ([whole.measured, *(part.measured for part in whole.parts)] for whole in (one, other))
        return agree(mine, its)

    def describe_success(self, parameters: P, judged: Sequence[JudgedTrial[Problem, Outcome]]) -> str:
        """Returns what is worth knowing of a right script, as sentences without numbers of hidden cases; empty if
        nothing is. Like `judge`, it must not raise."""
        return ""

    def build_pictures(self, parameters: P, visible: Sequence[JudgedTrial[Problem, Outcome]]) -> dict[str, Any]:
        """Returns the verdict's evidence as plain JSON (lists, no arrays). `charts` is drawn by the student's page: a
        list of {"case": the trial's id, "title", "x": {"label", "log"}, "y": {"label", "log"}, "series": [{"label",
        "x": [...], "y": [...]}], "marks": [{"y": a value to mark, "label"}]}.
        `motions` is such a list as well. `tables` is a list of {"case", "title", "head": [texts], "rows": [[texts]]}.
        `film` is {"title", "about"} for the box of the films, with what `record_films` needs to repeat the learner's
        own runs, under names of your own. Students see `motions` and `film`, which show no more than what the learner's
        own answer did, with the feedback; `charts`, `tables` and keys of your own with the solution. What has another
        shape is left out, and `grader check` reports it."""
        return {}

    def record_films(
        self, parameters: P, trials: Sequence[Trial[Problem]], evidence: Mapping[str, Any], failed: Collection[str],
        *, timestep_s: float | None = None,
    ) -> Sequence[Film]:  # fmt: skip
        """Returns films of a verdict, for which the page has a box where `build_pictures` returned a `film`. `trials`
        are the visible ones, as they were judged; `evidence`, and `failed`, the ids of failed trials, are as much of
        the verdict as the reader may see: a film shows no more than they tell.
        The evidence may be that of an older version. With `timestep_s`, which the reader has chosen, the runs at this
        timestep [s] alone, where the evidence tells what they show."""
        return ()

    def place_on_axes(self, parameters: P, verdict: Mapping[str, Any]) -> Iterable[Placed]:
        """Returns the numbers of a verdict, each on the axis of its limit: the page of a class draws one dot a learner
        there. `verdict` is a stored one as plain JSON, possibly of an older version; read its findings and evidence by
        the functions of grader.domain.axes, leave out what cannot be read, and simulate nothing. An axis has the same
        id in every verdict."""
        return ()

    def write_lazy_answers(
        self, question: ScriptQuestion, parameters: P, trials: Sequence[Trial[Problem]]
    ) -> Mapping[str, str]:
        """Returns scripts by name that answer every model alike; they may earn the points of the visible trials."""
        return {}

    def count_returned(self, trial: Trial[Problem]) -> int:
        """Returns the number of values that the student's function returns, as a tuple where there are several. `grader
        check` writes scripts that return as many values of an odd shape."""
        return 1

    def bound_luck(self, parameters: P, trials: Sequence[Trial[Problem]]) -> float | None:
        """Returns a bound of the chance that an answer which ignores its inputs passes these trials of one case. None:
        `list_accepted` says it."""
        return None

    def count_lucky(self, parameters: P, draws: Sequence[Sequence[Trial[Problem]]]) -> Sequence[int] | None:
        """Returns in how many draws of one case the best fixed answer is right, for each part of an answer whose draws
        are independent: where `list_accepted` is None, as right answers are no intervals, but answers can be tried.
        None: unknown."""
        return None

    def list_accepted(self, parameters: P, trials: Sequence[Trial[Problem]]) -> Sequence[Intervals] | None:
        """Returns the intervals of right answers to the trials of one case, for the chance of a fixed answer.

        An answer that ignores its inputs is a list of numbers; an interval holds the right values of one of them.
        Put the intervals that depend on the same draw into one item, and those of independent draws into items of their
        own. A case of one drawn model with the right answers `right` returns
        [[(value - tolerance, value + tolerance) for value in right]].

        None: unknown, which counts as a chance of 1 where `count_lucky` does not say it. `grader check` then
        refuses the exercise unless its `luck` is 1.
        """
        return None
