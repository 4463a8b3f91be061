"""Content is kept by digest, once, as a whole; what is missing or damaged is never taken for whole."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from threading import Thread

import pytest
from sqlalchemy import delete, func, select, update
from sqlalchemy.orm import Session

from grader.errors import ContentError, ContentLost, Fault
from grader.grading.content import Archive, Content, Contents
from grader.grading.pipeline import Pipeline
from grader.library import Library, load, load_files
from grader.store.contents import EVERY, ContentFile, ContentInUse, ContentManifest
from grader.store.engine.database import Database
from support.databases import BACKENDS, open_database

MODEL = "<mujoco><worldbody/></mujoco>"


@pytest.fixture(params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with open_database(request.param, tmp_path) as database:
        yield database


def write(root: Path, answer: int, *quizzes: str) -> Path:
    """Quizzes whose key is `answer`."""
    for folder in ("quizzes", "models"):
        (root / folder).mkdir(parents=True, exist_ok=True)
    (root / "models" / "pendulum.xml").write_text(MODEL)
    for path in (root / "quizzes").glob("*.json"):
        path.unlink()
    for quiz in quizzes or ("one", "two"):
        question = {"kind": "numeric", "q": "é?", "answer": answer, "tol": 0}
        (root / "quizzes" / f"{quiz}.json").write_text(json.dumps({"id": quiz, "title": quiz, "questions": [question]}))
    return root


def counts(database: Database) -> tuple[int, ...]:
    tables = (ContentFile, ContentManifest, ContentInUse)
    with database.read() as session:
        return tuple(session.scalar(select(func.count()).select_from(table)) or 0 for table in tables)


def in_use(session: Session) -> dict[str, str]:
    return {row.quiz: row.digest for row in session.scalars(select(ContentInUse))}


def test_a_quiz_made_again_of_its_files_has_the_same_digest(tmp_path: Path) -> None:
    library = load(write(tmp_path, 5))
    for quiz, files in library.sources.items():
        again = load_files(files)
        assert again.digests == {quiz: library.digest(quiz)}
        assert again.quiz(quiz) == library.quiz(quiz)


def test_content_is_kept_once_and_taken_by_a_process_that_never_loaded_it(database: Database, tmp_path: Path) -> None:
    content = Content(EVERY, write(tmp_path / "content", 5), Archive(database))
    assert counts(database) == (3, 2, 2)  # the model is shared
    old = content.library.digests
    content.reload()
    assert counts(database) == (3, 2, 2)
    write(tmp_path / "content", 6)
    content.reload()
    assert counts(database) == (5, 4, 2)
    archive, digests = Archive(database), [old["one"], content.library.digests["one"]]
    grades = [archive.get_pipeline("one", digest).grade("one", "q1", 5) for digest in digests]
    assert [verdict.status for verdict in grades] == ["correct", "incorrect"]
    assert [verdict.content_digest for verdict in grades] == digests
    with database.read() as session:
        assert in_use(session) == content.library.digests
        assert archive.current_library(session, "any", "one").digests == {"one": content.library.digests["one"]}


def test_a_quiz_that_is_gone_stays_for_what_was_made_against_it(database: Database, tmp_path: Path) -> None:
    content = Content(EVERY, write(tmp_path / "content", 5), Archive(database))
    old = content.library.digests["two"]
    write(tmp_path / "content", 5, "one")
    content.reload()
    archive = Archive(database)
    with database.read() as session:
        assert in_use(session) == content.library.digests
        assert not archive.current_library(session, "any", "two").quizzes
    assert archive.get_pipeline("two", old).grade("two", "q1", 5).points == 1


def test_refused_content_is_not_kept(database: Database, tmp_path: Path) -> None:
    content = Content(EVERY, write(tmp_path / "content", 5), Archive(database))
    before = content.pipeline
    (tmp_path / "content" / "quizzes" / "one.json").write_text("{}")
    with pytest.raises(ContentError):
        content.reload()
    assert content.pipeline is before
    assert counts(database) == (3, 2, 2)


def test_missing_and_damaged_content_is_lost_and_never_graded_with(database: Database, tmp_path: Path) -> None:
    digests = Content(EVERY, write(tmp_path / "content", 5), Archive(database)).library.digests
    with pytest.raises(ContentLost, match="does not hold"):
        Archive(database).get_pipeline("one", "f" * 64)
    with pytest.raises(ContentLost, match="make other content"):
        Archive(database).get_pipeline("one", digests["two"])
    with database.write() as session:
        session.execute(update(ContentFile).values(body=MODEL.encode() + b" "))
    with pytest.raises(ContentLost, match="in full"):
        Archive(database).get_pipeline("one", digests["one"])
    with database.write() as session:
        session.execute(delete(ContentFile))
    with pytest.raises(ContentLost, match="in full"):
        Archive(database).get_pipeline("two", digests["two"])


def test_servers_that_load_at_once_keep_one_of_each(database: Database, tmp_path: Path) -> None:
    root = write(tmp_path / "content", 5)
    failed: list[Exception] = []

    def start() -> None:
        try:
            Content(EVERY, root, Archive(database))
        except Exception as error:
            failed.append(error)

    threads = [Thread(target=start) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failed
    assert counts(database) == (3, 2, 2)


def test_a_course_with_a_folder_of_its_own_has_its_quizzes_alone(database: Database, tmp_path: Path) -> None:
    every, own = write(tmp_path / "every", 5, "one", "two"), write(tmp_path / "own", 6, "one")
    both = Contents(every, {"mechanics": own}, database)
    archive = Archive(database)

    def keys(course: str) -> list[float]:
        """What an answer of 5 is worth, by what servers and by what workers see."""
        with database.read() as session:
            library = archive.current_library(session, course, "one")
        return [both.get(course).pipeline.grade("one", "q1", 5).points, Pipeline(library).grade("one", "q1", 5).points]

    assert keys("mechanics") == [0, 0]
    assert keys("other") == [1, 1]
    with database.read() as session:
        assert not archive.current_library(session, "mechanics", "two").quizzes
        assert archive.current_library(session, "other", "two").quizzes
    both = Contents(every, {}, database)  # the course has its folder no longer
    assert keys("mechanics") == [1, 1]


def test_a_key_that_simulation_refuses_is_not_served(database: Database, tmp_path: Path) -> None:
    """As is one that is changed while the server runs: the old content stays, and the course's page says why."""
    root, verify = tmp_path / "content", {"by": "expression", "expr": "2 * 3"}
    write(root, 6, "one", "two")
    content = Content(EVERY, root, Archive(database))
    before = content.pipeline
    path = root / "quizzes" / "two.json"
    question = {"kind": "numeric", "q": "é?", "answer": 7, "tol": 0, "verify": verify}
    path.write_text(json.dumps({"id": "two", "title": "two", "questions": [question]}))
    with pytest.raises(ContentError, match=r"quizzes/two.json: q1.answer: .*6"):
        content.reload()
    assert [(fault.file, fault.key) for fault in content.refused] == [("quizzes/two.json", "q1.answer")]
    assert content.pipeline is before
    with pytest.raises(ContentError, match=r"quizzes/two.json: q1.answer"):
        Content(EVERY, root, Archive(database))
    path.write_text(json.dumps({"id": "two", "title": "two", "questions": [question | {"answer": 6}]}))
    content.reload()
    assert content.refused == ()


def test_quizzes_that_stayed_the_same_are_not_derived_again(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    derived: list[str] = []

    def refused(_library: Library, quizzes: Iterable[str], _passed: object) -> Iterator[Fault]:
        derived.extend(quizzes)
        return iter(())

    monkeypatch.setattr("grader.grading.content.find_refused_keys", refused)
    content = Content(EVERY, write(tmp_path / "content", 5), Archive(database))
    write(tmp_path / "content", 5, "one", "two", "three")
    content.reload()
    assert derived == ["one", "two", "three"]
