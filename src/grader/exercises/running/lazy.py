"""Scripts that do not solve an exercise: what `grader check` grades to see that they earn too little."""

from collections.abc import Mapping

from grader.exercises.kind import LazyAnswer, TextOf
from grader.exercises.running.planning import SEED, load_kinds, plan_exercise, refuse_text
from grader.questions import ModelXml
from grader.questions.kinds.script import ScriptQuestion

STARTER = "the starter"
NOTHING = "None from every function"

ODD: Mapping[str, tuple[str, str]] = {
    NOTHING: ("None", "None"),
    "empty arrays": ("np.zeros(0)", "np.zeros(0)"),
    "empty rows": ("np.zeros((0, 3))", "np.zeros((0, 3))"),
    "a column beside a row": ("np.zeros((300, 1))", "np.zeros((1, 300))"),
    "a row beside a column": ("np.zeros((1, 300))", "np.zeros((300, 1))"),
    "arrays with further axes": ("np.zeros((1, 1, 1, 1))", "np.zeros((1, 1, 1, 1))"),
    "nested lists": ("[[[0.0]]]", "[[[0.0]]]"),
}
"""What every function returns: the first, third, ... value and the others. All but None have a shape that no result
has; a judge that computes with them first may find nothing to object to."""


CONSTANT: Mapping[str, str] = {
    "0 from every function": "0.0",
    "1 from every function": "1.0",
    "a large number from every function": "987654.321",
}
"""What every function returns where the kind writes no lazy answers of its own: a judge that accepts anything, or what
is no result, gives them points."""


def write_lazy_answers(
    question: ScriptQuestion, model_xml: ModelXml, starter: str | None, text_of: TextOf = refuse_text
) -> list[LazyAnswer]:
    """Returns scripts that do not solve the exercise, with the points that each may earn at most. The starter may earn
    none. A script that answers every model alike may earn the points of the visible trials, and one that returns values
    of an odd shape no more than one that returns None. Those of models and files are as in `write_lazy_answers` of the
    kind: MJCF, or base64. A kind that writes none gets those of CONSTANT."""
    kind, plan = load_kinds()[question.check.kind], plan_exercise(question, model_xml, SEED, text_of)
    share = sum(trial.points for trial in plan.trials if not trial.hidden) / sum(trial.points for trial in plan.trials)
    alike, most = kind.write_lazy_answers(question, plan.parameters, plan.trials), share * question.points
    counts = {name: kind.count_returned(trial) for trial in plan.trials for name in trial.entries or (question.entry,)}
    odd = ODD if question.takes == "python" else {}
    if not alike and odd:
        alike = {name: write_returns(counts, (value, value)) for name, value in CONSTANT.items()}
    return [
        *([] if starter is None or question.form.is_file else [LazyAnswer(STARTER, starter, 0.0)]),
        *(LazyAnswer(name, source, most) for name, source in alike.items()),
        *(LazyAnswer(name, write_returns(counts, values), most, like=NOTHING) for name, values in odd.items()),
    ]


def write_returns(counts: Mapping[str, int], values: tuple[str, str]) -> str:
    """Returns a script whose functions return as many values as `counts` says of each, the two in turn."""
    functions = [
        f"def {name}(*arguments):\n    return {', '.join(values[index % 2] for index in range(max(count, 1)))}\n"
        for name, count in counts.items()
    ]
    return "\n\n".join(["import numpy as np\n", *functions])
