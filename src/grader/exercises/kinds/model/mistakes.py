"""Names the mistake behind a wrong model: variants of the reference, each with one mistake, are measured in the jail,
and one that does what the student's model does tells which it is."""

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from inspect import getsource
from itertools import combinations, islice

from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.exercises.driving.embedding import compile_code
from grader.exercises.kind import JudgedTrial, Mistake
from grader.exercises.kinds.model import matching, measuring
from grader.exercises.kinds.model.judge import ModelOutcome
from grader.exercises.kinds.model.parameters import Problem
from grader.exercises.kinds.model.reference_tree import Variant
from grader.exercises.kinds.model.variants import list_variants
from grader.exercises.kinds.model.xml_faults import PLAIN

DRIVER = 'exec(codes["measuring"])\nexec(codes["matching"])\n'
LIMITS = Limits(cpu_s=20, wall_s=60, memory_mb=512)

VARIANTS_MAX = 400
"""Variants of a reference that are measured: 0.2 s of CPU time of a model of ten elements."""
STEPS_MAX = 400_000
"""Steps that all variants may take together: 2 s of CPU time of a small model. Counted, so that load changes no
verdict."""

MISSING = re.compile(
    r"(?P<what>The (?:option |flag )?(?P<attribute>\w+)(?: of .+?)?) is missing(?:, so that MuJoCo's default holds)?"
)
"""The begin of a sentence on an attribute that a variant leaves out."""

SAME_MODEL = "The model does not depend on all of the numbers that the function gets."
FIXED = "In every case the model has the {name} of the first, whatever the function gets."
EXCHANGED = "The function takes {one} for {other}: mind the order of its arguments."
PAIRS_MAX = 10
"""Pairs of numbers that may be exchanged: of five numbers all."""

Judged = Sequence[JudgedTrial[Problem, ModelOutcome]]


def name_plain_mistake(judged: Judged) -> Mistake | None:
    """Returns why the model cannot be compiled, with its line where the model is what was handed in."""
    first = next((trial for trial in judged if trial.judgement.outcome.error), None)
    if first is None:
        return None
    outcome, is_program = first.judgement.outcome, first.script.tree is not None
    if outcome.is_plain:
        return Mistake(outcome.error)
    if is_program or not PLAIN.match(outcome.error):
        sentence = f"MuJoCo cannot compile the model: {outcome.error}"
        return Mistake(sentence, None if is_program else outcome.line)
    return Mistake(outcome.error, outcome.line)


def find_mistake(judged: Judged, run: Callable[[Job], RunReport]) -> Mistake | None:
    """Returns the mistake of the first variant that is like the student's model in every trial. Raises JailFault."""
    if not judged or any(trial.judgement.outcome.error or trial.judgement.outcome.missing for trial in judged):
        return None
    texts = list(dict.fromkeys(trial.problem.reference for trial in judged))
    steps = sum(round(trial.problem.case.seconds / trial.problem.measured["timestep"]) for trial in judged)
    most = min(VARIANTS_MAX, STEPS_MAX // steps) if steps else VARIANTS_MAX
    catalogues = [list(islice(list_variants(text), most)) for text in texts]
    if len({len(catalogue) for catalogue in catalogues}) != 1:
        return None
    rows = [*list_exchanged(judged, texts), *list_fixed(judged, texts), *zip(*catalogues, strict=True)]
    if len(texts) > 1:
        rows.insert(0, (Variant(texts[0], SAME_MODEL),) * len(texts))
    trials = [
        {**trial.problem.measured, "text": texts.index(trial.problem.reference),
         "found": trial.judgement.outcome.goals}
        for trial in sorted(judged, key=lambda each: each.problem.case.seconds)
    ]  # fmt: skip
    inputs = {"trials": trials, "variants": [[variant.xml for variant in row] for row in rows]}
    report = run(Job("", DRIVER, inputs, LIMITS, codes=compile_codes()))
    if report.status is not RunStatus.RETURNED or "match" not in report.results:
        return None
    match = int(report.results["match"])
    if not 0 <= match < len(rows):
        return None
    variant = rows[match][0]
    source = judged[0].script.source
    return Mistake(tell_written(variant.sentence, source, variant), find_line(source, variant))


def list_exchanged(judged: Judged, texts: Sequence[str]) -> Iterator[tuple[Variant, ...]]:
    """Yields, for each two numbers that a function gets, the references in which one stands for the other."""
    problems = {trial.problem.reference: trial.problem for trial in judged}
    numbers = [problems[text].numbers for text in texts]
    shared = [name for name in numbers[0] if all(name in each for each in numbers)]
    for one, other in islice(combinations(shared, 2), PAIRS_MAX):
        sentence = EXCHANGED.format(one=one, other=other)
        yield tuple(
            Variant(problems[text].write({**drawn, one: drawn[other], other: drawn[one]}), sentence)
            for text, drawn in zip(texts, numbers, strict=True)
        )


def list_fixed(judged: Judged, texts: Sequence[str]) -> Iterator[tuple[Variant, ...]]:
    """Yields, for each number that a function gets, the references in which it is always that of the first case."""
    problems = {trial.problem.reference: trial.problem for trial in judged}
    first = problems[texts[0]].numbers
    for name in first:
        numbers = [problems[text].numbers for text in texts]
        if all(name in each for each in numbers) and any(each[name] != first[name] for each in numbers):
            yield tuple(
                Variant(problems[text].write({**drawn, name: first[name]}), FIXED.format(name=name))
                for text, drawn in zip(texts, numbers, strict=True)
            )


def tell_written(sentence: str, source: str, variant: Variant) -> str:
    """Returns the sentence of an attribute that is missing, for a source in which it is written: it has its default."""
    missing = MISSING.match(sentence)
    if missing is None:
        return sentence
    name = rf"name\s*=\s*[\"']{re.escape(variant.name)}[\"']" if variant.name else ""
    tag = variant.tag or "option"
    if not any(
        re.search(rf"\b{missing['attribute']}\s*=", element) and re.search(name, element)
        for element in re.findall(rf"<{re.escape(tag)}\s[^<>]*>", source)
    ):
        return sentence
    return f"{missing['what']} is that which MuJoCo takes by default{sentence[missing.end() :]}"


@cache
def compile_codes() -> dict[str, bytes]:
    """Returns the code of the job."""
    return {
        name: compile_code(getsource(module)) for name, module in (("measuring", measuring), ("matching", matching))
    }


def find_line(source: str, variant: Variant) -> int | None:
    """Returns the line of an MJCF text that has the element of a variant, by its name; None where it has none."""
    if not variant.name:
        return None
    tag, name = (re.escape(text) for text in (variant.tag, variant.name))
    match = re.search(rf"<{tag}\s(?:[^<>]*\s)?name\s*=\s*[\"']{name}[\"']", source)
    return None if match is None else source.count("\n", 0, match.start()) + 1
