"""Gradescope's results.json. Source: gradescope-autograders.readthedocs.io, "Autograder Specifications". Every text has
the format `text`, so that nothing that a script prints is rendered as HTML, Markdown or colours."""

import json
from typing import Any

from grader.domain.verdict import POINT_DIGITS, Status
from grader.errors import JailFault
from grader.reports.graded import GradedAnswer

VISIBLE = "visible"
VISIBILITY = {"immediate": VISIBLE, "after_due": "after_due_date", "after_publish": "after_published"}
"""When a test is shown, by the feedback of the quiz's policy. `hidden` would also hide the student's total."""

LATER = "Your script was graded. Your course shows the feedback later."
NO_RESULT = "The grader itself failed: there is no result to report, and nothing is the student's mistake."


def results_json(graded: GradedAnswer) -> str:
    """Returns the verdict as the text of results.json. Raises JailFault for a fault of the grader, since any document
    would give points: without one, Gradescope tells student and staff that the autograder failed."""
    if graded.verdict.status is Status.GRADER_FAULT:
        raise JailFault(NO_RESULT)
    return json.dumps(build_document(graded), ensure_ascii=False, indent=2)


def build_document(graded: GradedAnswer) -> dict[str, Any]:
    """Returns the document as plain JSON."""
    verdict, visibility = graded.verdict, VISIBILITY[graded.quiz.default_policy.feedback]
    words = "\n".join(filter(None, (verdict.diagnosis, graded.summary)))
    shown_now = visibility == VISIBLE
    return {
        "score": verdict.points,
        "execution_time": round(verdict.timing_ms.get("total", 0.0) / 1000),
        "output": words if shown_now else LATER,
        "output_format": "text",
        "test_output_format": "text",
        "test_name_format": "text",
        "visibility": visibility,
        "stdout_visibility": "hidden",
        "tests": [*([] if shown_now else [check("Diagnosis", words, read_passed(graded))]), *build_tests(graded)],
        "extra_data": {
            "status": verdict.status.value,
            "max_points": verdict.max_points,
            "seed": graded.seed,
            "content_digest": verdict.content_digest,
            "submission_digest": verdict.submission_digest,
        },
    }


def build_tests(graded: GradedAnswer) -> list[dict[str, Any]]:
    """Returns a test for each finding, one for the whole question where there is none, and what the script printed."""
    verdict = graded.verdict
    tests = [
        build_test(name, graded.describe(finding), finding.passed, finding.points, finding.max_points)
        for name, finding in graded.findings
    ]
    if not tests:
        tests = [
            build_test(graded.title, verdict.diagnosis or "", read_passed(graded), verdict.points, verdict.max_points)
        ]
    printed = {"Output of the script": verdict.stdout, "Errors of the script": verdict.stderr}
    return [*tests, *(check(name, text, True) for name, text in printed.items() if text)]


def read_passed(graded: GradedAnswer) -> bool | None:
    """Says whether the answer is right; None while a person has to decide."""
    return None if graded.verdict.status is Status.NEEDS_REVIEW else graded.verdict.status is Status.CORRECT


def build_test(name: str, output: str, is_passed: bool | None, points: float, max_points: float) -> dict[str, Any]:
    """Returns a test with points; an undecided one has none yet, and one without points is a check."""
    test = check(name, output, is_passed)
    if is_passed is None or not max_points:
        return test
    return test | {"score": round(points, POINT_DIGITS), "max_score": round(max_points, POINT_DIGITS)}


def check(name: str, output: str, is_passed: bool | None) -> dict[str, Any]:
    """Returns a test without points."""
    status = {} if is_passed is None else {"status": "passed" if is_passed else "failed"}
    return {"name": name, "output": output, **status}
