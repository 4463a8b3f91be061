"""The script of a verdict: the statement that the diagnosis is about, its neighbours, what is folded, the advice."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from grader.grading.spans import find_span
from grader.web.verdict.marked_script import FOLDED_MAX, find_advice, mark_script

NUMBERED = "\n".join(f"line {number}" for number in range(1, 13))


def numbers(lines: Any) -> list[int]:
    return [line.number for line in lines]


def test_the_statement_of_the_span_is_marked_and_what_is_far_is_folded() -> None:
    span = {"line": 6, "column": 2, "end_line": 7, "end_column": 4}
    script = mark_script(NUMBERED, {"line": 6, "span": span, "diagnosis": "It is. Do that."})
    assert script is not None
    assert [(line.number, line.before, line.marked, line.after) for line in script.hot] == [
        (6, "li", "ne 6", ""), (7, "", "line", " 7"),
    ]  # fmt: skip
    assert (numbers(script.above), numbers(script.shown)) == ([1, 2], [3, 4, 5, 6, 7])
    assert (numbers(script.rest), numbers(script.below)) == ([8, 9, 10], [11, 12])
    assert script.advice == "Do that."


def test_a_line_without_a_span_is_marked_without_its_indentation() -> None:
    script = mark_script("def f():\n    return 1 +\n", {"line": 2, "span": None, "diagnosis": "No."})
    assert script is not None
    assert [(line.before, line.marked) for line in script.hot] == [("    ", "return 1 +")]


def test_an_older_verdict_names_the_line_in_its_diagnosis() -> None:
    script = mark_script(NUMBERED, {"diagnosis": "ValueError: no, in line 7 of your script."})
    assert script is not None
    assert numbers(script.hot) == [7]
    assert mark_script(NUMBERED, {"diagnosis": "in line 99 of your script"}) is None
    assert mark_script(NUMBERED, {"diagnosis": "It ends."}) is None
    assert mark_script("", {"line": 1, "diagnosis": "It ends."}) is None


def test_a_long_script_is_not_shown_whole() -> None:
    script = mark_script("x = 1\n" * 2000, {"line": 1000, "diagnosis": "No."})
    assert script is not None
    assert len(script.above) == len(script.below) == FOLDED_MAX
    assert script.above[-1].number + 1 == script.shown[0].number


@given(
    st.lists(st.sampled_from(["x = 1", "if x:", "    y = (", "        2)", "", "é = 'ü'  # ß"]), max_size=12), st.data()
)
def test_no_text_is_lost_whatever_the_line(lines: list[str], data: st.DataObject) -> None:
    source = "\n".join(lines)
    line = data.draw(st.integers(1, max(1, len(source.splitlines()))))
    span = find_span(source, line)
    verdict = {"line": line, "span": None if span is None else span.model_dump(), "diagnosis": "No."}
    script = mark_script(source, verdict)
    if script is None:
        assert not source.splitlines()
        return
    shown = [*script.above, *script.shown, *script.rest, *script.below]
    assert [one.text or " " for one in shown] == [one or " " for one in source.splitlines()]
    assert line in numbers(script.hot)


def test_the_advice_is_what_follows_the_fault() -> None:
    assert find_advice("k3 is used twice. Evaluate k4 at the end, with k3.") == "Evaluate k4 at the end, with k3."
    assert find_advice("data.act does not change: advance it with data.act_dot.") == "Advance it with data.act_dot."
    assert find_advice("You adopted Euler.") == "You adopted Euler."
    assert find_advice("NameError: name 'x' is not defined.") == "NameError: name 'x' is not defined."
    assert find_advice("SyntaxError: expected ':' (line 3: def f(model))") == "SyntaxError: expected ':'"
    assert find_advice("ValueError: no, in line 14 of your script (do this).") == "ValueError: no (do this)."
    missing = "NameError: name 'np' is not defined{} (add the line: import numpy as np)."
    assert find_advice(missing.format(", in line 3 of your script")) == missing.format("")
    whole = "TypeError: no (the lengths of arrays are whole numbers: int(round(x)) makes one)."
    assert find_advice(whole) == whole
    two = "Two things are wrong. First: Your k1 is late. Call it first. Second: Your sum is 2."
    assert find_advice(two) == "Your k1 is late. Call it first."
    assert find_advice(f"{two} Apart from that: data.time stands.") == "Your k1 is late. Call it first."
    assert find_advice("Your k1 is late. Apart from that: data.time stands.") == "Your k1 is late."
    diagnosis = "All are the last one: data.qacc is a view, so copy it. If you did, the sum is wrong."
    assert find_advice(diagnosis) == "data.qacc is a view, so copy it. If you did, the sum is wrong."
