"""The gradebook: what is written is read back, spreadsheets run nothing, and rows are streamed."""

import csv
import io
import math
import re
import tracemalloc
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.courses.rules.csv_cells import guard, unguard
from grader.courses.rules.gradebook import Column, Form, LearnerRow, gradebook_csv, list_headings, number

COLUMNS = [
    Column("1.3-check", "q1", "Knowledge check, 1", 1.0, "4711"),
    Column("1.3-exercises", "rk4-step", 'The "RK4"\nstep', 3.0),
]
IDS = [("1.3-check", "q1"), ("1.3-exercises", "rk4-step")]
ADA = LearnerRow("Ada Löwe", "ada", "7f3a", "ada@uni.example", "A", "17", "s17", {IDS[0]: 1.0, IDS[1]: 2.25})
BOB = LearnerRow("bob", "bob", points={IDS[1]: 1 / 3})
RUNS = "=+-@\t\r"

texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=8)
texts |= st.tuples(st.text("'", max_size=2), st.sampled_from(RUNS), texts).map("".join)
points = st.dictionaries(st.sampled_from(IDS), st.floats(0, 1000).map(lambda value: round(value, 9)))
learners = st.builds(
    LearnerRow, texts, texts, texts, texts, texts, texts, texts, points, st.sampled_from(["", "…7f3a"])
)


def lines(
    rows: Sequence[LearnerRow], form: Form = Form.GENERIC, columns: Sequence[Column] = COLUMNS
) -> list[list[str]]:
    """The cells, read by the csv module."""
    return list(csv.reader(list(gradebook_csv(rows, columns, form)), strict=True))


def test_the_generic_form() -> None:
    assert "".join(gradebook_csv([ADA, BOB], COLUMNS)) == (
        "user,id,email,1.3-check/q1,1.3-exercises/rk4-step,points,max_points\r\n"
        "Ada Löwe,7f3a,ada@uni.example,1,2.25,3.25,4\r\n"
        "bob,,,,0.333333333,0.333333333,4\r\n"
    )


def test_a_name_begins_no_new_cell_where_semicolons_separate_them() -> None:
    """As Excel reads the file in countries where the decimal sign is a comma."""
    row = LearnerRow("Eve;=1+1;", "eve\t=1+1")
    line = list(gradebook_csv([row], COLUMNS))[-1]
    for separator in ";\t":
        (read,) = csv.reader([line], delimiter=separator, strict=False)
        assert not any(cell.startswith("=") for cell in read), read
    assert lines([row])[-1][0] == "Eve;=1+1;"


def test_canvas_gets_its_header_order_and_its_assignments() -> None:
    assert lines([ADA, BOB], Form.CANVAS) == [
        ["Student", "ID", "SIS User ID", "SIS Login ID", "Section", "Knowledge check, 1 (4711)", 'The "RK4" step'],
        ["    Points Possible", "", "", "", "", "1", "3"],
        ["Ada Löwe", "17", "s17", "ada", "A", "1", "2.25"],
        ["bob", "", "", "bob", "", "", "0.333333"],
    ]


def test_the_sum_of_a_quiz_is_rounded_once_for_an_lms_and_full_points_stay_full() -> None:
    row = LearnerRow("cem", "cem", points={("a", ""): 4 / 3 + 2 / 3, ("b", ""): 4 / 3})
    columns = [Column("a", "", "A", 2.0), Column("b", "", "B", 4 / 3)]
    _, most, got = lines([row], Form.CANVAS, columns)
    assert most[-2:] == got[-2:] == ["2", "1.333333"]
    assert lines([row], Form.MOODLE, columns)[-1][-2:] == ["2", "1.333333"]
    assert lines([row], columns=columns)[-1][-4:-1] == ["2", "1.333333333", "3.333333333"]


def test_moodle_gets_columns_to_map_by_hand() -> None:
    assert lines([ADA], Form.MOODLE) == [
        ["Username", "Email address", "ID number", "Knowledge check, 1", 'The "RK4" step'],
        ["ada", "ada@uni.example", "s17", "1", "2.25"],
    ]


@given(st.lists(learners, max_size=4))
def test_what_was_written_is_read_back(rows: list[LearnerRow]) -> None:
    header, *written = lines(rows)
    keys = [tuple(name.split("/")) for name in header[3:-2]]
    assert keys == IDS
    back = [
        ([unguard(cell) for cell in cells[:3]], {k: float(c) for k, c in zip(IDS, cells[3:-2], strict=True) if c})
        for cells in written
    ]
    assert back == [([row.user, row.id, row.email], row.points) for row in rows]
    learner = {
        Form.CANVAS: [
            [f"{row.user} {row.mark}" if row.mark else row.user, row.lms_id, row.sis_id, row.login, row.section]
            for row in rows
        ],
        Form.MOODLE: [[row.login, row.email, row.sis_id] for row in rows],
    }
    for form, expected in learner.items():
        first = 2 if form is Form.CANVAS else 1
        assert [[unguard(cell) for cell in line[: -len(COLUMNS)]] for line in lines(rows, form)[first:]] == expected


@given(st.lists(learners, min_size=1, max_size=3), st.sampled_from(list(Form)))
def test_no_cell_is_a_formula(rows: list[LearnerRow], form: Form) -> None:
    columns = [Column("-quiz", "q", f"{rows[0].user}=1", 1.0), Column("quiz", "q", "=cmd|' /C calc'!A0", 1.0)]
    for line in csv.reader(list(gradebook_csv(rows, columns, form))):
        assert not [cell for cell in line if cell.lstrip(" ").startswith(tuple(RUNS))]


@given(texts, texts)
def test_different_texts_stay_different(one: str, other: str) -> None:
    assert (guard(one) == guard(other)) == (one == other)
    assert unguard(guard(one)) == one


@given(st.floats(0, 1e6))
def test_points_have_no_exponent_and_nine_digits(value: float) -> None:
    text = number(value)
    assert set(text) <= set("0123456789.")
    assert float(text) == pytest.approx(value, abs=5e-10 + 2 * math.ulp(1e6))


def test_equal_and_empty_titles_are_told_apart() -> None:
    columns = [Column("a", f"q{n}", title, 1) for n, title in enumerate(["Check", "Check", "Section", " "], 1)]
    assert list_headings(columns, Form.CANVAS) == ["Check [a/q1]", "Check [a/q2]", "Section [a/q3]", "[a/q4]"]
    assert list_headings(columns, Form.MOODLE) == ["Check [a/q1]", "Check [a/q2]", "Section", "[a/q4]"]


def test_the_column_of_a_quiz_bears_its_id() -> None:
    columns = [Column("a", "", "Check", 2), Column("b", "", "Check", 1)]
    assert list_headings(columns, Form.GENERIC) == ["a", "b"]
    assert list_headings(columns, Form.CANVAS) == ["Check [a]", "Check [b]"]


# -- a reader that acts like Canvas's importer -------------------------------------------------------------------------


@dataclass
class Canvas:
    """A course in Canvas: assignments by id, students by number. Source: canvas-lms, lib/gradebook_importer.rb."""

    assignments: dict[int, tuple[str, float | None]]
    students: dict[int, tuple[str, str, str]]
    """Name, SIS user id and login by number."""
    grades: dict[tuple[int, int], float] = field(default_factory=dict)
    unknown: list[str] = field(default_factory=list)

    def upload(self, text: str) -> None:
        """Imports a gradebook: finds assignments by id, then by title, and makes the others."""
        header, *rows = list(csv.reader(io.StringIO(text.removeprefix("\ufeff"), newline=""), strict=True))
        assert "Student" in header[0] and "ID" in header[1] and "Section" in header[4]
        assert re.search(r"SIS\s+User\s+ID", header[2]) and re.search(r"SIS\s+Login\s+ID", header[3])
        totals = ("Current", "Final", "Override"), ("Score", "Points", "Grade", "Status")
        titles = [one for one in header[5:] if not any(f"{a} {b}" in one for a in totals[0] for b in totals[1])]
        columns = {self._assignment(title): header.index(title) for title in titles}
        for row in rows:
            if "Points Possible" in row[0]:
                for number, place in columns.items():
                    self.assignments[number] = self.assignments[number][0], float(row[place])
            elif (student := self._student(row)) is None:
                self.unknown.append(row[0])
            else:
                self.grades |= {(student, number): float(row[at]) for number, at in columns.items() if row[at]}

    def _assignment(self, heading: str) -> int:
        numbered = re.fullmatch(r"(.*)\s\((\d+)\)", heading, re.DOTALL)
        if numbered and int(numbered[2]) in self.assignments:
            return int(numbered[2])
        title = numbered[1] if numbered else heading
        matching = [number for number, (name, _) in self.assignments.items() if name == heading]
        made = matching[0] if matching else -len(self.assignments) - 1
        self.assignments.setdefault(made, (title, None))
        return made

    def _student(self, row: list[str]) -> int | None:
        if row[1].isdigit() and int(row[1]) in self.students:
            return int(row[1])
        for student, (_, sis_id, login) in self.students.items():
            if row[2] == sis_id != "" or row[3] == login != "":
                return student
        return next((student for student, (name, _, _) in self.students.items() if name == row[0]), None)


def uploaded(
    canvas: Canvas, rows: Sequence[LearnerRow], columns: Sequence[Column] = COLUMNS, **options: bool
) -> Canvas:
    canvas.upload("".join(gradebook_csv(rows, columns, Form.CANVAS, **options)))
    return canvas


@pytest.mark.parametrize("bom", [False, True])
def test_canvas_finds_assignments_and_students_and_makes_the_rest_with_points(bom: bool) -> None:
    canvas = Canvas({4711: ("Knowledge check, 1", 1.0)}, {17: ("Löwe", "s17", "ada"), 18: ("B.", "s18", "bob")})
    for _ in range(2):  # a second upload finds by title what the first one has made
        uploaded(canvas, [ADA, BOB], bom=bom)
    assert canvas.assignments == {4711: ("Knowledge check, 1", 1.0), -2: ('The "RK4" step', 3.0)}
    assert canvas.grades == {(17, 4711): 1.0, (17, -2): 2.25, (18, -2): 0.333333}
    assert canvas.unknown == []


TITLES = [
    "Step (2)",
    "Step",
    "Final Score",
    "A Final Grade of mine",
    "Override Status",
    "Points Possible",
    "ID",
    "=1+1",
]


def test_no_title_leads_canvas_to_another_assignment_or_is_dropped() -> None:
    columns = [Column("quiz", f"q{n}", title, float(n)) for n, title in enumerate(TITLES, 1)]
    points = {("quiz", f"q{n}"): n / 2 for n in range(1, len(TITLES) + 1)}
    canvas = Canvas({2: ("Somebody else's", 100.0)}, {17: ("", "", "ada")})
    uploaded(canvas, [LearnerRow("ada", "ada", points=points)], columns)
    assert canvas.assignments[2] == ("Somebody else's", 100.0)
    assert sorted(canvas.grades.values()) == sorted(points.values())
    assert sorted(worth or 0 for _, worth in canvas.assignments.values()) == [*map(float, range(1, 9)), 100.0]


def test_a_learner_who_calls_themselves_points_possible_or_like_another_changes_nothing() -> None:
    canvas = Canvas({4711: ("Knowledge check, 1", 1.0)}, {17: ("Ada", "s17", "ada")})
    impostor = LearnerRow("ada", points={IDS[0]: 0.0})  # a name of their own choice is no login
    uploaded(canvas, [ADA, impostor, LearnerRow("My Points Possible", points={IDS[0]: 0.5})])
    assert canvas.assignments[4711][1] == 1.0
    assert canvas.grades[17, 4711] == 1.0
    assert canvas.unknown == ["ada", "My Points_Possible"]


# -- a reader that acts like Moodle's importer -------------------------------------------------------------------------


def moodle(text: str, mapped_by: str, users: dict[str, int], mapping: dict[str, int]) -> dict[tuple[int, int], float]:
    """Grades by (user, item), with the columns mapped by hand; one user who is not found ends the import.

    Source: moodle, grade/import/csv/classes/load_data.php.
    """
    header, *rows = list(csv.reader(io.StringIO(text.removeprefix("\ufeff"), newline=""), strict=True))
    header = [cell.strip() for cell in header]
    grades: dict[tuple[int, int], float] = {}
    for row in rows:
        user = users[row[header.index(mapped_by)]]
        for title, item in mapping.items():
            if (cell := row[header.index(title)].strip()) not in ("", "-"):
                grades[user, item] = float(cell)
    return grades


@pytest.mark.parametrize(
    ("mapped_by", "users"),
    [
        ("Username", {"ada": 3, "bob": 4}),
        ("ID number", {"s17": 3, "": 4}),
        ("Email address", {"ada@uni.example": 3, "": 4}),
    ],
)
def test_moodle_reads_the_points_with_columns_mapped_by_hand(mapped_by: str, users: dict[str, int]) -> None:
    text = "".join(gradebook_csv([ADA, BOB], COLUMNS, Form.MOODLE, bom=True))
    mapping = {"Knowledge check, 1": 1, 'The "RK4" step': 2}
    assert moodle(text, mapped_by, users, mapping) == {(3, 1): 1.0, (3, 2): 2.25, (4, 2): 0.333333}


def test_only_the_first_line_has_the_mark_of_utf8() -> None:
    written = list(gradebook_csv([ADA], COLUMNS, bom=True))
    assert [line.startswith("\ufeff") for line in written] == [True, False]
    assert "".join(written).encode().decode("utf-8-sig") == "".join(gradebook_csv([ADA], COLUMNS))


def test_rows_are_streamed() -> None:
    taken = 0

    def rows() -> Iterator[LearnerRow]:
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
