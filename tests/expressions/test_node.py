"""Every expression of the lesson and of the course's examples, and some hundreds more, against Node."""

import random
from pathlib import Path
from typing import Any, Literal

from expressions import fuzz, node
from expressions.node import Case, Outcome

HERE = Path(__file__).parent


def corpus() -> list[Case]:
    """Lines of expressions.txt: `= ` an expression, `; ` a statement list, `# ` a comment."""
    cases = []
    for line in (HERE / "expressions.txt").read_text().splitlines():
        kind: Literal["expression", "statement"] = "expression" if line.startswith("= ") else "statement"
        if line.startswith(("= ", "; ")):
            cases.append(Case(kind, line[2:]))
    return cases


def complaint(case: Case, here: Outcome, there: dict[str, Any]) -> str | None:
    """How our outcome differs from Node's, if it does. What Node refuses, we refuse."""
    if "error" in there:
        return None if isinstance(here, str) else f"{case.text}: runs here, in Node {there['error']}"
    if isinstance(here, str):
        return f"{case.text}: refused here ({here}), Node gives {there['value']}"
    m, value = here
    if not node.same(value, there["value"]):
        return f"{case.text}: {value!r} here, {there['value']} in Node"
    different = node.same_state(m, there) if case.kind == "statement" else []
    return f"{case.text}: {different} differ afterwards" if different else None


def complaints(cases: list[Case]) -> list[str]:
    """Every difference between here and Node."""
    return [
        c
        for case, there in zip(cases, node.run_node(cases), strict=True)
        if (c := complaint(case, node.run_here(case), there))
    ]


def complaints_about_accepted(cases: list[Case], more_than: int) -> list[str]:
    """Every difference in what runs here, which must be so many cases."""
    accepted = [(case, here) for case in cases if not isinstance(here := node.run_here(case), str)]
    assert len(accepted) > more_than
    answers = node.run_node([case for case, _ in accepted])
    return [c for (case, here), there in zip(accepted, answers, strict=True) if (c := complaint(case, here, there))]


def test_the_corpus_means_what_it_means_in_node() -> None:
    cases = corpus()
    assert len(cases) > 300
    differences = complaints(cases)
    assert not differences, "\n".join(differences)


def test_random_expressions_mean_what_they_mean_in_node() -> None:
    rng = random.Random(20260101)
    differences = complaints([Case("expression", fuzz.expression(rng, 5)) for _ in range(500)])
    assert not differences, "\n".join(differences)


def test_random_statements_mean_what_they_mean_in_node() -> None:
    rng = random.Random(20260102)
    differences = complaints([Case("statement", fuzz.statements(rng)) for _ in range(300)])
    assert not differences, "\n".join(differences)


def test_random_loops_mean_what_they_mean_in_node() -> None:
    rng = random.Random(20260104)
    cases = [Case("statement", fuzz.loops(rng)) for _ in range(250)]
    differences = complaints_about_accepted(cases, more_than=80)
    assert not differences, "\n".join(differences)


def test_damaged_texts_are_refused_or_mean_what_they_mean_in_node() -> None:
    rng = random.Random(20260103)
    texts = [case.text for case in corpus()]
    damaged = [Case(case.kind, fuzz.damage(rng, case.text, texts)) for case in corpus() for _ in range(8)]
    differences = complaints_about_accepted(damaged, more_than=300)
    assert not differences, "\n".join(differences)
