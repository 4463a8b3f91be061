"""What the client shows: everything is escaped, also what a hostile server or script would write."""

import re
import time
from typing import Any

import pytest

from mjgrader.checking import Check
from mjgrader.pictures import draw_evidence
from mjgrader.showing import Answer, Progress, write_moment

EVIL = "<script>alert(1)</script>\"'&<img src=x onerror=y>"
SITE = "https://grader.example.edu"


def make_submission(**verdict: Any) -> dict[str, Any]:
    whole = {"status": "partial", "points": 1.0, "max_points": 3.0, "findings": [], "diagnosis": None, "evidence": {}}
    return {"id": "s1", "quiz": "q", "question": "e", "status": "graded", "attempt": 2, "verdict": {**whole, **verdict}}


def test_everything_in_the_html_of_a_verdict_is_escaped() -> None:
    finding = {"title": EVIL, "message": EVIL, "passed": False}
    angle = {"case": EVIL, "end": EVIL, "timestep_ms": 2.0, "time_s": [0, 1], "angle": [1, 0]}
    submission = make_submission(
        diagnosis=EVIL, findings=[finding], stdout=EVIL, stderr=EVIL, evidence={"angles": [angle]}
    )
    shown = Answer({**submission, "question": EVIL, "withheld": EVIL}, SITE)._repr_html_()
    assert "<svg" in shown
    check = Check(EVIL, ({**finding, "raised": False},), EVIL, (EVIL,))._repr_html_()
    progress = Progress([{"id": EVIL, "questions": [{"id": EVIL, "points": 1, "due": None}]}])._repr_html_()
    for markup in (shown, check, progress):
        assert "<script" not in markup
        assert "<img" not in markup
        assert "&lt;script&gt;" in markup


def test_a_verdict_as_text_has_diagnosis_cases_and_attempts() -> None:
    findings = [
        {"title": "visible", "message": "Too low.", "passed": False},
        {"title": "hidden case 1", "passed": True},
    ]
    text = str(Answer(make_submission(diagnosis="You forgot kv.", findings=findings), SITE, 1))
    assert text.startswith("partial: 1 of 3 points\nYou forgot kv.\n")
    assert "wrong  visible: Too low." in text
    assert "right  hidden case 1\n" in text
    assert "1 attempt is left." in text


def test_cases_under_several_integrators_are_a_matrix() -> None:
    findings = [
        {"title": f"{case}, {name}", "passed": passed, "message": "", "raised": False}
        for case, passed in (("lesson", True), ("hidden case 1", False))
        for name in ("Euler", "discrete")
    ]
    markup = Check("t", tuple(findings))._repr_html_()
    assert markup.count("\u2713") == markup.count("\u2717") == 2


@pytest.mark.parametrize(
    "evidence",
    [
        {"angles": 3},
        {"angles": [{}]},
        {"charts": [{"title": "x"}]},
        {"differences": [{"case": 1}]},
        {"order": {"error": 1}},
    ],
)
def test_evidence_of_another_shape_is_left_out(evidence: dict[str, Any]) -> None:
    assert list(draw_evidence(evidence)) == []


def test_lines_leave_out_what_has_no_place_on_their_axis() -> None:
    difference = {"case": "c", "time_s": [0, 1, 2], "qpos": [0.0, 1e-9, None], "qvel": [1e-8, 1e300, 1e-7]}
    order = {"timestep_ms": [4, 2, 1], "error": [1e-4, 1e-5, None]}
    drawn = "".join(draw_evidence({"differences": [difference], "order": order}))
    assert drawn.count("<svg") == 2
    assert "nan" not in drawn
    assert all(-1 <= float(x) <= 500 for x in re.findall(r"(-?[\d.]+),", drawn))


def test_a_due_date_is_in_the_time_zone_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    try:
        assert write_moment("2026-10-05T20:30:00Z") == "Tue 06 Oct 2026, 05:30 JST"
    finally:
        monkeypatch.undo()
        time.tzset()
    assert write_moment(None) == ""
