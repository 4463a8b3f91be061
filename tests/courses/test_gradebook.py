"""The gradebook: what is written is read back, spreadsheets run nothing, and rows are streamed."""

import csv
import math
import tracemalloc
from collections.abc import Iterator, Sequence
from itertools import islice

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.courses.gradebook import Column, Form, Row, gradebook_csv, guarded, headings, number
from properties import patient

COLUMNS = [
    Column("1.3-check", "q1", "Knowledge check, 1", 1.0, "4711"),
    Column("1.3-exercises", "rk4-step", 'The "RK4"\nstep', 3.0),
]
IDS = [("1.3-check", "q1"), ("1.3-exercises", "rk4-step")]
ADA = Row("ada", "Ada Löwe", "ada@uni.example", "A", "17", "s17", {IDS[0]: 1.0, IDS[1]: 2.25})
BOB = Row("bob", points={IDS[1]: 1 / 3})
RUNS = "=+-@\t\r"

texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=8)
texts |= st.tuples(st.text("'", max_size=2), st.sampled_from(RUNS), texts).map("".join)
points = st.dictionaries(st.sampled_from(IDS), st.floats(0, 1000).map(lambda value: round(value, 9)))
learners = st.builds(Row, texts, texts, texts, texts, texts, texts, points)


def lines(rows: Sequence[Row], form: Form = Form.GENERIC) -> list[list[str]]:
    """The cells, read by the csv module."""
    return list(csv.reader(list(gradebook_csv(rows, COLUMNS, form)), strict=True))


def plain(cell: str) -> str:
    """A cell without the apostrophe that keeps a spreadsheet from running it."""
    return cell[1:] if cell.startswith("'") and guarded(cell[1:]) == cell else cell


def test_the_generic_form() -> None:
    assert "".join(gradebook_csv([ADA, BOB], COLUMNS)) == (
        "user,name,email,1.3-check/q1,1.3-exercises/rk4-step,points,max_points\r\n"
        "ada,Ada Löwe,ada@uni.example,1,2.25,3.25,4\r\n"
        "bob,,,,0.333333333,0.333333333,4\r\n"
    )


def test_canvas_gets_its_header_order_and_its_assignments() -> None:
    assert lines([ADA, BOB], Form.CANVAS) == [
        ["Student", "ID", "SIS User ID", "SIS Login ID", "Section", "Knowledge check, 1 (4711)", 'The "RK4" step'],
        ["Ada Löwe", "17", "s17", "ada", "A", "1", "2.25"],
        ["bob", "", "", "bob", "", "", "0.333333333"],
    ]


def test_moodle_gets_columns_to_map_by_hand() -> None:
    assert lines([ADA], Form.MOODLE) == [
        ["Username", "Email address", "Knowledge check, 1", 'The "RK4" step'],
        ["ada", "ada@uni.example", "1", "2.25"],
    ]


@patient
@given(st.lists(learners, max_size=4))
def test_what_was_written_is_read_back(rows: list[Row]) -> None:
    header, *found = lines(rows)
    keys = [tuple(name.split("/")) for name in header[3:-2]]
    assert keys == IDS
    back = [
        ([plain(cell) for cell in cells[:3]], {k: float(c) for k, c in zip(IDS, cells[3:-2], strict=True) if c})
        for cells in found
    ]
    assert back == [([row.user, row.name, row.email], row.points) for row in rows]
    learner = {
        Form.CANVAS: [[row.name or row.user, row.lms_id, row.sis_id, row.user, row.section] for row in rows],
        Form.MOODLE: [[row.user, row.email] for row in rows],
    }
    for form, expected in learner.items():
        assert [[plain(cell) for cell in line[: -len(COLUMNS)]] for line in lines(rows, form)[1:]] == expected


@patient
@given(st.lists(learners, min_size=1, max_size=3), st.sampled_from(list(Form)))
def test_no_cell_is_a_formula(rows: list[Row], form: Form) -> None:
    columns = [Column("-quiz", "q", f"{rows[0].name}=1", 1.0), Column("quiz", "q", "=cmd|' /C calc'!A0", 1.0)]
    for line in csv.reader(list(gradebook_csv(rows, columns, form))):
        assert not [cell for cell in line if cell.lstrip(" ").startswith(tuple(RUNS))]


@patient
@given(texts, texts)
def test_different_texts_stay_different(one: str, other: str) -> None:
    assert (guarded(one) == guarded(other)) == (one == other)
    assert plain(guarded(one)) == one


@patient
@given(st.floats(0, 1e6))
def test_points_have_no_exponent_and_nine_digits(value: float) -> None:
    text = number(value)
    assert set(text) <= set("0123456789.")
    assert float(text) == pytest.approx(value, abs=5e-10 + 2 * math.ulp(1e6))


def test_equal_and_empty_titles_are_told_apart() -> None:
    columns = [Column("a", f"q{n}", title, 1) for n, title in enumerate(["Check", "Check", "Section", " "], 1)]
    assert headings(columns, Form.CANVAS) == ["Check [a/q1]", "Check [a/q2]", "Section [a/q3]", "[a/q4]"]
    assert headings(columns, Form.MOODLE) == ["Check [a/q1]", "Check [a/q2]", "Section", "[a/q4]"]


def test_only_the_first_line_has_the_mark_of_utf8() -> None:
    written = list(gradebook_csv([ADA], COLUMNS, bom=True))
    assert [line.startswith("\ufeff") for line in written] == [True, False]
    assert "".join(written).encode().decode("utf-8-sig") == "".join(gradebook_csv([ADA], COLUMNS))


def test_rows_are_streamed() -> None:
    taken = 0

    def rows() -> Iterator[Row]:
        nonlocal taken
        while True:
            taken += 1
            yield ADA

    written = gradebook_csv(rows(), COLUMNS)
    assert len(list(islice(written, 3))) == 3
    assert taken == 2
    tracemalloc.start()
    for _ in islice(written, 5000):
        pass
    held = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert held < 100_000  # 5,000 lines of 50 bytes
