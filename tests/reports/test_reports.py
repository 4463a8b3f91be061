"""Verdicts as Gradescope's results.json and as JUnit XML: each fits the format and tells what a learner may see."""

import json
import math
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema_rs
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.domain.policy import Policy
from grader.domain.verdict import Finding, Status, Verdict
from grader.errors import JailFault
from grader.reports import GradedAnswer, junit_xml, results_json
from support.content import load_content

ROOT = Path(__file__).parents[2]
SCHEMA = jsonschema_rs.validator_for(json.loads((Path(__file__).parent / "gradescope.schema.json").read_text()))

NASTY = "<script>&]]>\x00\x1b[31m\u202e\ufffe \U0001f600 'é\""
text = st.sampled_from(["", "hidden case 1, Euler", NASTY, "one\ntwo"]) | st.text(max_size=8).filter(str.isprintable)
points = st.floats(0, 100)
findings = st.builds(
    Finding, id=text, title=text, passed=st.sampled_from([True, False, None]), points=points, max_points=points,
    message=text, measured=st.none() | text, expected=st.none() | text,
)  # fmt: skip
verdicts = st.builds(
    Verdict, status=st.sampled_from(list(Status)), points=points, max_points=points,
    findings=st.lists(findings, max_size=4).map(tuple), diagnosis=st.none() | text, read_as=st.none() | text,
    stdout=text, stderr=text, timing_ms=st.dictionaries(st.just("total"), st.floats(0, 1e5)),
)  # fmt: skip


def graded(verdict: Verdict, seed: int | None = 7, **policy: Any) -> GradedAnswer:
    quiz = load_content().quiz("1.3-exercises").model_copy(update={"default_policy": Policy(**policy)})
    return GradedAnswer(quiz, quiz.questions[0], verdict, seed)


def results(verdict: Verdict, **policy: Any) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(results_json(graded(verdict, **policy)))
    return document


def cases(verdict: Verdict) -> dict[str, tuple[str, str]]:
    """Status and output of each test case by name, read as GitLab reads them: the second of two equal names is lost."""
    by_case: dict[str, tuple[str, str]] = {}
    root = ElementTree.fromstring(junit_xml(graded(verdict)))
    assert root.tag == "testsuites"
    for suite in root.findall("testsuite"):
        for case in suite.findall("testcase"):
            outcome = next(iter(case), None)
            read = ("success", "") if outcome is None else (outcome.tag, outcome.text or "")
            by_case.setdefault(f"{case.attrib['classname']} {case.attrib['name']}", read)
    return by_case


def finding(title: str, passed: bool | None, **rest: Any) -> Finding:
    return Finding(
        id=title, title=title, passed=passed, points=float(bool(passed)), max_points=1.0, message="m", **rest
    )


VERDICT = Verdict(
    status=Status.PARTIAL, points=1.0, max_points=2.0, diagnosis="You forgot the damper.", stdout="hello <b>",
    findings=(finding("Euler", True, measured="20.1 ms", expected="20 ms"), finding("hidden case 1", False)),
)  # fmt: skip


# -- Gradescope --------------------------------------------------------------------------------------------------------


@given(
    verdicts.filter(lambda verdict: verdict.status is not Status.GRADER_FAULT),
    st.sampled_from(["immediate", "after_publish"]),
)
def test_every_verdict_fits_gradescopes_format(verdict: Verdict, feedback: str) -> None:
    document = results(verdict, feedback=feedback)
    SCHEMA.validate(document)
    assert document["score"] == verdict.points


def test_the_diagnosis_comes_first_and_each_finding_is_a_test_with_its_points() -> None:
    document = results(VERDICT)
    assert document["output"].splitlines() == ["You forgot the damper.", "partial: 1 of 2 points"]
    assert document["tests"] == [
        {"name": "Euler", "output": "m\nmeasured: 20.1 ms", "status": "passed", "score": 1.0, "max_score": 1.0},
        {"name": "hidden case 1", "output": "m", "status": "failed", "score": 0.0, "max_score": 1.0},
        {"name": "Output of the script", "output": "hello <b>", "status": "passed"},
    ]
    assert {document[f"{what}_format"] for what in ("output", "test_output", "test_name")} == {"text"}
    assert document["visibility"] == "visible"


@pytest.mark.parametrize(
    ("feedback", "visibility"), [("after_due", "after_due_date"), ("after_publish", "after_published")]
)
def test_feedback_that_comes_later_is_hidden_until_then(feedback: str, visibility: str) -> None:
    due = {"due": "2026-03-01T12:00:00Z"} if feedback == "after_due" else {}
    document = results(VERDICT, feedback=feedback, **due)
    assert document["visibility"] == visibility
    assert "damper" not in document["output"] and "partial" not in document["output"]
    assert document["tests"][0]["name"] == "Diagnosis"
    assert "You forgot the damper." in document["tests"][0]["output"]
    assert not [test for test in document["tests"] if "visibility" in test]  # none is shown earlier


@pytest.mark.parametrize(
    ("solutions", "status", "is_shown"),
    [("with_feedback", Status.PARTIAL, True), ("when_right_or_spent", Status.PARTIAL, False),
     ("when_right_or_spent", Status.CORRECT, True), ("never", Status.CORRECT, False)],
)  # fmt: skip
def test_what_was_expected_is_told_where_the_policy_tells_it(solutions: str, status: Status, is_shown: bool) -> None:
    verdict = VERDICT.model_copy(update={"status": status})
    assert ("expected: 20 ms" in results_json(graded(verdict, solutions=solutions))) == is_shown
    assert ("expected: 20 ms" in junit_xml(graded(verdict, solutions=solutions))) is False  # it passed: no text at all


def test_a_script_that_did_not_run_is_one_failed_test() -> None:
    crashed = Verdict(status=Status.CRASHED, points=0.0, max_points=3.0, diagnosis="SyntaxError in line 3")
    [test] = results(crashed)["tests"]
    assert (test["status"], test["score"], test["max_score"]) == ("failed", 0.0, 3.0)
    assert test["output"] == "SyntaxError in line 3"


def test_a_fault_of_the_grader_gives_no_document() -> None:
    fault = Verdict(status=Status.GRADER_FAULT, points=0.0, max_points=3.0)
    with pytest.raises(JailFault, match="no result to report"):
        results_json(graded(fault))


def test_the_points_of_the_tests_add_up() -> None:
    thirds = tuple(finding(str(n), True).model_copy(update={"points": 1 / 3, "max_points": 1 / 3}) for n in range(3))
    document = results(VERDICT.model_copy(update={"findings": thirds, "points": 1.0}))
    scores = [test["score"] for test in document["tests"] if "score" in test]
    assert math.fsum(scores) == pytest.approx(document["score"], abs=1e-8)


# -- JUnit -------------------------------------------------------------------------------------------------------------

REQUIRED, OPTIONAL = True, False
OUTCOME = dict.fromkeys(("type", "message"), OPTIONAL)
SHAPE: dict[str, tuple[dict[str, bool], list[str]]] = {
    "testsuites": (dict.fromkeys(("name", "time", "tests", "failures", "errors"), OPTIONAL), ["testsuite"]),
    "testsuite": (
        dict.fromkeys(("name", "tests", "failures", "errors"), REQUIRED)
        | dict.fromkeys(
            ("group", "time", "skipped", "timestamp", "hostname", "id", "package", "file", "log", "url"), OPTIONAL
        ),
        ["properties", "testcase", "system-out", "system-err", "testsuite"],
    ),
    "properties": ({}, ["property"]),
    "property": ({"name": REQUIRED, "value": REQUIRED}, []),
    "testcase": (
        {"name": REQUIRED, "time": OPTIONAL, "classname": OPTIONAL, "group": OPTIONAL},
        ["skipped", "error", "failure", "system-out", "system-err"],
    ),
    "failure": (OUTCOME, []),
    "error": (OUTCOME, []),
    "skipped": (OUTCOME, []),
    "system-out": ({}, []),
    "system-err": ({}, []),
}
"""Every attribute and child of each element that we write, but for the reruns of Surefire.

Source: junit-10.xsd of Jenkins' xUnit plug-in as of November 2025. It leaves the order of children
open; they stand here in the order that Apache Ant's schema asks for.
"""
WITH_TEXT = {"failure", "error", "skipped", "system-out", "system-err"}
SUITE_TIME = re.compile(r"[0-9]*(\.[0-9]*)?")
"""The times of suites without separators of thousands. Source: as above, SUREFIRE_TIME."""


def check_shape(element: ElementTree.Element) -> None:
    """Asserts that an element and all below it are as SHAPE says."""
    attributes, children = SHAPE[element.tag]
    assert element.attrib.keys() <= attributes.keys(), element.tag
    assert {name for name, required in attributes.items() if required} <= element.attrib.keys(), element.tag
    order = [children.index(child.tag) for child in element]
    assert order == sorted(order), element.tag
    assert element.tag in WITH_TEXT or not (element.text or "").strip(), element.tag
    assert not (element.tail or "").strip(), element.tag
    if element.tag.startswith("testsuite"):
        assert SUITE_TIME.fullmatch(element.attrib["time"])
    for child in element:
        check_shape(child)


@given(verdicts)
def test_every_verdict_is_a_junit_document_whose_counts_hold(verdict: Verdict) -> None:
    root = ElementTree.fromstring(junit_xml(graded(verdict)))
    check_shape(root)
    [suite] = root
    counts = {kind: len(suite.findall(f"testcase/{kind}")) for kind in ("failure", "error", "skipped")}
    assert [suite.attrib[name] for name in ("failures", "errors", "skipped")] == [str(n) for n in counts.values()]
    assert root.attrib.items() <= suite.attrib.items() | {("name", "grader")}
    assert int(suite.attrib["tests"]) == len(verdict.findings) + 1
    names = [case.attrib["name"] for case in suite.findall("testcase")]
    assert len(set(names)) == len(names)


def test_a_reader_like_gitlabs_finds_the_diagnosis_and_the_failed_case() -> None:
    title = "1.3-exercises.servo-threshold The largest stable timestep"
    assert cases(VERDICT) == {
        title: ("failure", "You forgot the damper.\npartial: 1 of 2 points"),
        f"{title}: Euler": ("success", ""),
        f"{title}: hidden case 1": ("failure", "m"),
    }


@pytest.mark.parametrize(
    ("status", "outcome"),
    [(Status.CORRECT, "success"), (Status.TIMED_OUT, "failure"), (Status.INVALID_ANSWER, "failure"),
     (Status.NEEDS_REVIEW, "skipped"), (Status.GRADER_FAULT, "error")],
)  # fmt: skip
def test_every_status_has_its_outcome(status: Status, outcome: str) -> None:
    verdict = Verdict(status=status, points=0.0, max_points=1.0)
    assert [kind for kind, _ in cases(verdict).values()] == [outcome]


def test_findings_of_one_title_stay_apart() -> None:
    twice = VERDICT.model_copy(update={"findings": (finding("Euler", True), finding("Euler", False))})
    assert len(cases(twice)) == 3
    assert len({test["name"] for test in results(twice)["tests"]}) == 3
