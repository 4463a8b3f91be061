"""The service's study measures the real server: every row that the page shows comes out of it."""

import json
from itertools import islice
from pathlib import Path
from random import Random

import pytest

from grader.domain.verdict import Status
from grader.library import load
from grader.questions import grade_answer, installed_kinds
from grader.questions.kinds.script import ScriptQuestion
from grader.settings import Settings
from grader.studies.bench.service import answers, workers
from grader.studies.bench.service.classroom import QUIZ, list_kinds, make_answers, write_class
from grader.studies.bench.service.script import PROGRAMS, Script, compare_with_bare, read_program
from grader.studies.bench.service.service import Beside
from grader.studies.bench.service.workers import Workers
from support.content import PASSED
from support.databases import BACKENDS


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
def test_answers_are_measured_beside_both_bare_routes(backend: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answers, "LEARNERS", 10)
    monkeypatch.setattr(answers, "WARM_UP_S", 0.1)
    study = Beside(backend, 2)
    record = study.measure(True, {})
    rows = {row["server"]: row for row in study.rows(record)}
    assert set(rows) == {"service", "each", "gathered"}
    for row in rows.values():
        assert row["submissions"] > 0 and row["cpu_s"] > 0
        assert row["per_second_least"] <= row["per_second"] <= row["per_second_most"]
        assert 0 < row["median_s"] <= row["p95_s"] <= row["p99_s"]
    for commits in ("each", "gathered"):
        assert 0 < rows[commits]["ratio_least"] <= rows[commits]["ratio"] <= rows[commits]["ratio_most"]


def test_a_class_answers_every_kind_and_types_new_numbers(tmp_path: Path) -> None:
    write_class(tmp_path)
    questions = json.loads((tmp_path / "quizzes" / f"{QUIZ}.json").read_text())["questions"]
    assert {type(kind) for kind in list_kinds().values()} == {
        type(kind) for kind in installed_kinds().values() if not kind.is_script
    }
    assert [question["id"] for question in questions] == list(list_kinds())
    given = list(islice(make_answers(Random(1)), 4000))
    assert {name for name, _ in given} == set(list_kinds())
    library = load(tmp_path)
    graded = [grade_answer(library.question(QUIZ, name), answer).status for name, answer in given]
    assert Status.INVALID_ANSWER not in graded
    typed = [answer for name, answer in given if name == "numeric"]
    assert 0.25 < len(typed) / len(given) < 0.35
    assert 0.4 < len(set(typed)) / len(typed) < 0.6


@pytest.mark.slow
def test_a_queue_is_worked_off_by_more_and_more_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "WORKER_COUNTS", (1, 2))
    record = Workers("empty").measure(True, {})
    assert [run["workers"] for run in record["runs"]] == [1, 2]
    assert record["runs"][0]["ratio"] == 1
    assert all(run["per_second"] > 0 and run["cores"] > 0 for run in record["runs"])


@pytest.mark.slow
def test_a_script_is_measured_beside_its_bare_function() -> None:
    """On SQLite: the same server is measured on PostgreSQL with the answers above."""
    study = Script("servo-threshold", "whole_runs_in_one_call", "sqlite")
    (row,) = study.rows(study.measure(True, {}))
    parts = ("whole", "child", "judge", "service")
    assert all(row[f"{part}_s"] > 0 and row[f"{part}_ratio"] > 0 for part in parts)
    assert row["child_ratio"] > 1  # the bare function is a part of it
    assert 0 < row["bare_s"] < row["whole_s"]
    assert row["imported_s"] > 0.05


@pytest.mark.slow
def test_the_same_is_measured_without_a_server() -> None:
    ratio = compare_with_bare("servo-threshold", "whole_runs_in_one_call", "child", 2)
    assert len(ratio.pairs) == 2
    assert all(0 < pair < 3 for pair in ratio.pairs)  # below 1 where nothing else runs


def test_every_exercise_of_the_first_lesson_is_measured() -> None:
    library = load(Settings().content, passed=PASSED)
    exercises = {
        (quiz.id, question.id)
        for quiz in library.quizzes.values()
        for question in quiz.questions
        if isinstance(question, ScriptQuestion)
    }
    assert exercises == {("1.3-exercises", exercise) for exercise in PROGRAMS}
    for exercise, programs in PROGRAMS.items():
        assert all(read_program(exercise, program) for program in programs)
