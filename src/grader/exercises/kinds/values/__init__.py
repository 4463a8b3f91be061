"""The `values` kind judges the results of functions. It compares them with those of an author's program, or puts them
into a residual, and names the mistake that gives them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from inspect import getsource
from typing import Any

from grader.domain.axes import Placed
from grader.domain.run import Job, RunReport
from grader.exercises.kind import DrawnCase, Intervals, JudgedTrial, Judgement, Kind, Mistake, Results, TextOf, Trial
from grader.exercises.kinds.values.input_mistakes import CLAIMS
from grader.exercises.kinds.values.judging import driver
from grader.exercises.kinds.values.judging.described import describe
from grader.exercises.kinds.values.judging.judge import Comparisons, compute_tolerance, judge_calls
from grader.exercises.kinds.values.mistakes import name_by_edits, name_the_mistake
from grader.exercises.kinds.values.parameters import Problem, ValuesCase, ValuesParameters, pose_case
from grader.exercises.kinds.values.pictures import build_evidence
from grader.exercises.kinds.values.placing import place_results
from grader.exercises.kinds.values.rehearsal import count_lucky_answers, rehearse_call
from grader.questions import Reveal
from grader.questions.kinds.script import ScriptQuestion


class Values(Kind[ValuesParameters, Problem, Comparisons]):
    """Judges the results of functions: one trial for each case, in which every call must be right."""

    parameters = ValuesParameters
    driver = getsource(driver)
    how = "Your function is called with the inputs of each case, and its results are compared with the author's."
    needs_model = False
    runs_wrong_programs = True
    claims = CLAIMS

    def build_trials(self, parameters: ValuesParameters, drawn: DrawnCase[ValuesCase]) -> Sequence[Trial[Problem]]:
        """Returns the calls of one case."""
        problem = pose_case(parameters, drawn)
        return [Trial(drawn.case.id, problem.inputs(), problem, entries=(problem.name,))]

    def describe_problem(
        self, reveal: Reveal | None, parameters: ValuesParameters, trial: Trial[Problem]
    ) -> Mapping[str, Any] | None:
        """Returns the expected results where the author reveals them; None where a residual of the author's decides."""
        if reveal != "value" or trial.problem.function.residual is not None:
            return None
        return describe(trial.problem)

    def rehearse(self, parameters: ValuesParameters, trial: Trial[Problem]) -> None:
        """Runs the author's programs. Raises ValueError if one gives no results, or others than are declared."""
        for call in trial.problem.calls:
            rehearse_call(trial.problem, call)

    def judge(self, parameters: ValuesParameters, trial: Trial[Problem], results: Results) -> Judgement[Comparisons]:
        """Compares every call with the author's program, or computes its residual."""
        return judge_calls(trial.problem, results)

    def write_wrong_script(self, parameters: ValuesParameters, index: int, text_of: TextOf) -> str:
        """Returns the author's program, with the functions of the wrong one in place of its own."""
        return f"{text_of(parameters.program)}\n\n{text_of(parameters.mistakes[index].program)}"

    def name_mistake(
        self, parameters: ValuesParameters, judged: Sequence[JudgedTrial[Problem, Comparisons]]
    ) -> str | None:
        """Returns the sentence of the first mistake that explains the wrong results."""
        return name_the_mistake(parameters, judged)

    def name_mistake_by_runs(
        self,
        parameters: ValuesParameters,
        judged: Sequence[JudgedTrial[Problem, Comparisons]],
        run: Callable[[Job], RunReport],
    ) -> Mistake | None:
        """Returns the mistake of the edited program that gives the wrong results, or of the edit that mends them."""
        return name_by_edits(parameters, judged, run)

    def build_pictures(
        self, parameters: ValuesParameters, visible: Sequence[JudgedTrial[Problem, Comparisons]]
    ) -> dict[str, Any]:
        """Returns a table of computed and expected results."""
        return build_evidence(visible)

    def place_on_axes(self, parameters: ValuesParameters, verdict: Mapping[str, Any]) -> Iterable[Placed]:
        """Returns the worst deviation of each case in tolerances."""
        return place_results(parameters, verdict)

    def write_lazy_answers(
        self, question: ScriptQuestion, parameters: ValuesParameters, trials: Sequence[Trial[Problem]]
    ) -> Mapping[str, str]:
        """Returns a script whose functions return 0."""
        names = dict.fromkeys(trial.problem.name for trial in trials)
        return {"0 for every call": "".join(f"def {name}(*arguments):\n    return 0.0\n\n" for name in names)}

    def count_returned(self, trial: Trial[Problem]) -> int:
        """Returns the number of results that are not left in a field of data."""
        return sum(result.field is None for result in trial.problem.function.results)

    def count_lucky(
        self, parameters: ValuesParameters, draws: Sequence[Sequence[Trial[Problem]]]
    ) -> Sequence[int] | None:
        """Returns in how many draws the best of some fixed answers satisfies the residual, call by call."""
        return count_lucky_answers([trials[0].problem for trials in draws])

    def list_accepted(
        self, parameters: ValuesParameters, trials: Sequence[Trial[Problem]]
    ) -> Sequence[Intervals] | None:
        """Returns the intervals of each call's results; calls are independent unless they share a drawn model."""
        (trial,) = trials
        parts: list[list[tuple[float, float]]] = []
        for call in trial.problem.calls:
            expected = trial.problem.compute_expected(call)
            if expected is None:
                return None
            part = []
            for result, right in zip(trial.problem.function.results, expected, strict=True):
                around = compute_tolerance(result, right)
                part += [(value - around, value + around) for value in right.ravel().tolist()]
            parts.append(part)
        return parts if trial.problem.independent else [[interval for part in parts for interval in part]]
