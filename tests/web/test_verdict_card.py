"""What the card of a verdict says: the matrix, what is folded, the excerpt of a script that raised."""

from datetime import UTC, datetime
from typing import Any

import pytest

from grader.domain.verdict import NO_COMMENT, Status
from grader.web.frame.rendering import templates
from grader.web.text.statuses import STATUSES, describe_status
from grader.web.verdict.card import Card, build_card, build_matrix, describe_value, link_lines
from grader.web.verdict.work import GivenAnswer
from web.evidence import threshold_verdict

AT = datetime(2026, 11, 21, tzinfo=UTC)


def finding(title: str, passed: bool | None, message: str = "", **rest: Any) -> dict[str, Any]:
    return {"id": title, "title": title, "passed": passed, "points": 1.0 if passed else 0.0, "max_points": 1.0,
            "message": message} | rest  # fmt: skip


def card(verdict: dict[str, Any], source: str = "") -> Card:
    built = build_card(
        GivenAnswer("id", 2, AT, {"source": source}, "graded", {"points": 0.0, "max_points": 3.0} | verdict, None)
    )
    assert built is not None
    return built


def test_every_status_has_a_word_an_icon_and_a_tone() -> None:
    assert {*STATUSES} == {*Status}
    assert len({told.word for told in STATUSES.values()}) == len(Status)


def test_a_kind_of_another_package_has_a_box_for_its_films() -> None:
    film = {"title": "Your targets, let go", "about": "The judge's run.", "runs": [[0.0]]}
    box = card({"status": "incorrect", "evidence": {"film": film}}).film
    assert box is not None
    assert (box.title, box.about, box.choice) == ("Your targets, let go", "The judge's run.", "Your targets, let go")
    page = templates.env.from_string('{% from "film.html" import film_box %}{{ film_box("id", box) }}').render(box=box)
    assert "<option>Your targets, let go</option>" in page and "bracket" not in page
    assert card({"status": "incorrect", "evidence": {"film": {"runs": [[0.0]]}}}).film is None


def test_a_withheld_answer_was_received_and_no_more() -> None:
    assert describe_status("needs_review", withheld=True).word == "Received"
    assert describe_status("crashed", withheld=True).word == "Ended with an error"


def test_cases_by_integrators_are_a_matrix_and_failed_rows_stand_open() -> None:
    shown = card(threshold_verdict("spring"))
    assert shown.columns == ("Euler", "implicitfast", "discrete")
    assert shown.rows[0].title == "kp = 2000, kv = 5"
    euler = shown.rows[0].cells[0]
    assert (euler.badge.word, euler.measured) == ("too high", "22.05 to 22.44\u202fms")
    assert "a limit from 19.98\u202fms" in euler.expected
    assert shown.rows[1].title == "Hidden case 1"
    assert shown.rows[1].cells[0].measured == ""


def test_hidden_cases_that_fail_alike_are_one_line() -> None:
    same, other = "Departs from MuJoCo's RK4.", "The time is wrong."
    hidden = [finding(f"hidden case {number}", False, same) for number in (1, 2, 3)]
    passed = [finding(f"hidden case {number}", True) for number in (5, 6)]
    pair = [finding(f"hidden case {number}", False, same) for number in (7, 8)]
    findings = [finding("seen", False, same), *hidden, finding("hidden case 4", False, other), *passed, *pair]
    shown = card({"status": "incorrect", "findings": findings})
    assert [(cell.title, cell.of) for cell in shown.failed] == [
        ("Seen", 1.0),
        ("Hidden cases 1 to 3", 3.0),
        ("Hidden case 4", 1.0),
        ("Hidden cases 7 and 8", 2.0),
    ]
    assert len(shown.passed) == 2


def test_parts_of_hidden_cases_that_fail_alike_are_one_line() -> None:
    parts = ("settling time", "overshoot")
    hidden = [finding(f"hidden case {number}: {part}", False, part) for number in (1, 2, 4) for part in parts]
    shown = card({"status": "incorrect", "findings": hidden})
    assert [(cell.title, cell.of) for cell in shown.failed] == [
        ("Hidden cases 1 and 2: settling time", 2.0),
        ("Hidden cases 1 and 2: overshoot", 2.0),
        ("Hidden case 4: settling time", 1.0),
        ("Hidden case 4: overshoot", 1.0),
    ]


@pytest.mark.parametrize(
    ("message", "measured", "shown"),
    [
        ("Measured 3.756; at most 0.05 is allowed.", 3.75583, ""),
        ("It leaves [-1.5, 1.5] by 177.2.", 177.23, ""),
        ("It is smaller. In yours: model.nu = 1.", "model.nu = 1", ""),
        ("It departs at step 1.", 1.0031, "1.0031"),
        ("It is off by 0.943 s.", 0.9424, "0.9424"),
        ("It is off.", [39.95, 40.05], "39.95 to 40.05"),
        ("It is off.", [1.4414, 1.6696, 2.75], "1.4414, 1.6696, 2.75"),
    ],
)
def test_what_the_message_has_is_not_said_again(message: str, measured: object, shown: str) -> None:
    (cell,) = card({"status": "incorrect", "findings": [finding("a", False, message) | {"measured": measured}]}).failed
    assert cell.measured == shown


def test_a_diagnosis_that_begins_with_a_case_has_a_capital_letter() -> None:
    diagnosis = "from hanging to 1.2 rad: It overshoots."
    findings = [finding("from hanging to 1.2 rad: overshoot", False, "It overshoots.")]
    assert card({"status": "incorrect", "diagnosis": diagnosis, "findings": findings}).diagnosis.startswith(
        "From hanging"
    )


def test_a_syntax_error_is_shown_at_its_line() -> None:
    diagnosis = "SyntaxError: expected ':' (line 2: def f())"
    shown = card({"status": "crashed", "diagnosis": diagnosis}, source="import mujoco\ndef f()\n    pass")
    assert shown.script is not None
    assert [line.text for line in shown.script.hot] == ["def f()"]


def test_what_passed_is_folded() -> None:
    passed = [finding("one, x", True), finding("one, y", True, measured=3), finding("two, y", True)]
    shown = card({"status": "partial", "findings": [*passed, finding("two, x", False, "Too low: by far.")]})
    assert [row.title for row in shown.rows] == ["Two"]
    assert [row.title for row in shown.passed_rows] == ["One"]
    assert shown.passed_rows[0].cells[1].measured == ""
    assert (shown.rows[0].cells[0].badge.word, shown.rows[0].cells[0].message) == ("too low", "By far.")


def test_a_comment_of_a_reviewer_stands_open_whatever_the_points() -> None:
    def render(message: str) -> str:
        shown = card({"status": "correct", "findings": [finding("review", True, message)]})
        return templates.env.from_string(
            '{% from "verdict.html" import verdict_card %}{{ verdict_card(card) }}'
        ).render(card=shown)

    commented, silent = render("Well argued."), render(NO_COMMENT)
    assert "Well argued." in commented.partition("<details>")[0]
    assert NO_COMMENT not in silent.partition("<details>")[0]


def test_findings_that_are_no_matrix_are_a_list() -> None:
    shown = card(
        {"status": "partial", "findings": [finding("a body, 2 steps", False, "Departs."), finding("order", True)]}
    )
    assert (shown.columns, shown.rows) == ((), ())
    assert [cell.title for cell in shown.failed] == ["A body, 2\u00a0steps"]
    assert [cell.title for cell in shown.passed] == ["Order"]


@pytest.mark.parametrize("titles", [["a, x", "a, y", "b, x"], ["a, x", "a, x"], ["a, x"], [", x", ", y"], []])
def test_only_a_full_table_is_a_matrix(titles: list[str]) -> None:
    assert build_matrix([finding(title, True) for title in titles]) == ((), ())


def test_a_sentence_that_many_cells_say_is_said_once() -> None:
    why = "No timestep is unstable: return None."
    shown = card({"status": "incorrect", "findings": [finding(f"{a}, {b}", False, why) for a in "ab" for b in "xy"]})
    assert shown.notes == ("x, y: No timestep is unstable: return None.",)


def test_a_note_names_its_cases_where_others_of_the_column_failed_otherwise() -> None:
    none = "No timestep is unstable: return None."
    shown = card({"status": "incorrect", "findings": [
        finding("one, x", False, "Too low: by far."), finding("one, y", False, none),
        finding("two, x", False, none), finding("two, y", False, none),
    ]})  # fmt: skip
    assert shown.notes == (f"y, x (Two): {none}",)


def test_cases_that_fail_alike_in_all_columns_are_named_once_and_the_diagnosis_is_not_said_again() -> None:
    seen = [finding(f"seen, {column}", False, "TypeError: no f.") for column in "xy"]
    hidden = [finding(f"hidden case {n}, {column}", False, "TypeError.") for n in (1, 2, 3) for column in "xy"]
    shown = card({"status": "incorrect", "findings": [*seen, *hidden], "diagnosis": "seen, x: TypeError: no f."})
    assert shown.notes == ("Hidden cases 1 to 3: TypeError.",)


def test_a_line_that_is_named_leads_to_the_editor_where_its_script_is_there() -> None:
    diagnosis = "NameError: <b>, in line 2 of your script. Line 12 hid it; timeline 3 did not."
    assert link_lines(diagnosis) == (
        'NameError: &lt;b&gt;, in <a href="#answer" data-go-to="2">line 2</a> of your script. '
        '<a href="#answer" data-go-to="12">Line 12</a> hid it; timeline 3 did not.'
    )
    assert "data-go-to" not in rendered(card({"status": "crashed", "diagnosis": diagnosis}))


def test_measured_values_are_said_in_words() -> None:
    assert describe_value({"qpos": 1.78e-15, "max_v": 0.25}) == "qpos 1.78·10⁻¹⁵, max v 0.25"
    assert describe_value([1.0, 2.5]) == "1 to 2.5"
    assert describe_value(None) == describe_value(True) == ""


def test_a_rubric_is_a_list_and_no_measurement() -> None:
    rubric = {"rubric": [{"title": "names the damper", "points": 0.5}]}
    shown = card({"status": "partial", "findings": [finding("review", None, "Good.", measured=rubric)]})
    assert shown.failed[0].rubric == ("names the damper (0.5)",)
    assert shown.failed[0].measured == ""


TABLEAU = {
    "of": "positions and velocities",
    "given": {"a": [[], ["1/2"], ["1/2", "0"]], "b": ["1/6", "1/3", "1/2"], "c": ["0", "1/2", "1/2"]},
    "asked": {"a": [[], ["1/2"], ["0", "1/2"]], "b": ["1/6", "1/3", "1/2"], "c": ["0", "1/2", "1/2"]},
    "wrong": [["a", 2, 0], ["a", 2, 1]],
}


def rendered(shown: Card) -> str:
    macro = templates.env.get_template("verdict.html").module.verdict_card  # type: ignore[attr-defined]
    return str(macro(shown))


def test_two_tableaus_stand_side_by_side_and_the_wrong_cells_are_framed() -> None:
    page = rendered(card({"status": "incorrect", "evidence": {"tableau": TABLEAU}}))
    assert page.count("<caption>") == 2
    assert page.count('class="wrong no"') == page.count('class="wrong ok"') == 2
    assert '<td class="wrong no">½</td><td class="wrong no">0</td>' in page
    assert "<caption>" not in rendered(card({"status": "correct", "evidence": {"tableau": TABLEAU | {"wrong": []}}}))


def test_what_a_script_says_of_itself_is_text() -> None:
    hostile = "<script>alert(1)</script>"
    verdict = {"status": "crashed", "diagnosis": f"{hostile}, in line 1 of your script", "stdout": hostile}
    page = rendered(card(verdict | {"findings": [finding(hostile, False, hostile, measured=hostile)]}, source=hostile))
    assert "<script>" not in page
    assert page.count("&lt;script&gt;") >= 5


def test_a_script_that_ended_in_every_case_has_one_line_and_no_matrix() -> None:
    said = "Rename largest_timestep to largest_stable_timestep: the grader calls largest_stable_timestep."
    titles = [f"{case}, {column}" for case in ("seen", "hidden case 1") for column in ("Euler", "RK4")]
    shown = card(
        {"status": "crashed", "diagnosis": said, "findings": [finding(title, False, said) for title in titles]}
    )
    assert (shown.diagnosis, shown.columns, shown.rows, shown.cells) == (said, (), (), ())
    assert shown.notes == ("No case ran to its end.",)
    alone = card({"status": "crashed", "diagnosis": said, "findings": []})
    assert alone.notes == ()


def test_a_right_script_has_its_remark() -> None:
    remark = "All 21 cases hold, the 18 hidden ones too."
    assert card({"status": "correct", "remark": remark, "findings": [finding("a", True)]}).diagnosis == remark
    assert card({"status": "correct", "findings": [finding("a", True)]}).diagnosis == ""
