"""Names are found and sorted without case and accents, alike on both databases."""

import unicodedata
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import literal, select

from grader.store import people
from grader.store.engine.database import Database
from grader.store.engine.names import Folded, fold_name, holds
from grader.store.tables import Member
from support.databases import BACKENDS, open_database

NAMES = ("Zoë", "ada", "Émile", "eva_1", "Eva 50%", "Ångström", "Øre", "a/b", "Жанна")


@pytest.fixture(scope="module", params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    with open_database(request.param, tmp_path_factory.mktemp("names")) as database:
        with database.write() as session:
            for name in NAMES:
                session.add(Member(id=name, course="c", name=name, role="student", account=name))
        yield database


def test_they_are_sorted_as_a_reader_expects(database: Database) -> None:
    with database.read() as session:
        sorted_names = [member.name for member in people.list_by_name(session, "c", 0, 100)]
    latin = [name for name in sorted_names if name not in ("Øre", "Жанна", "a/b")]
    assert latin == ["ada", "Ångström", "Émile", "Eva 50%", "eva_1", "Zoë"]


@pytest.mark.parametrize(
    ("part", "found"),
    [
        ("Émile", {"Émile"}),
        ("EMILE", {"Émile"}),
        ("émi", {"Émile"}),
        ("zoe", {"Zoë"}),
        ("angstrom", {"Ångström"}),
        ("Жанна", {"Жанна"}),
        ("%", {"Eva 50%"}),
        ("_", {"eva_1"}),
        ("/", {"a/b"}),
        ("EVA", {"Eva 50%", "eva_1"}),
        ("nobody", set()),
    ],
)
def test_they_are_found(database: Database, part: str, found: set[str]) -> None:
    with database.read() as session:
        assert {member.name for member in people.list_without_results(session, "c", ["quiz"], part)} == found
        assert set(session.scalars(select(Member.name).where(holds(Member.name, part)))) == found


@pytest.mark.parametrize("name", [*NAMES, "", "Éa\u0300", "I\u0307", "ẞ", "Việt Nguyễn"])
def test_both_databases_fold_latin_names_alike(database: Database, name: str) -> None:
    with database.read() as session:
        told = session.scalar(select(Folded(literal(name))))
    assert unicodedata.normalize("NFC", told or "").lower() == fold_name(name)


@given(st.text())
def test_folding_twice_changes_nothing_more(text: str) -> None:
    once = fold_name(text)
    assert once is not None
    assert fold_name(fold_name(once)) == fold_name(once)
    assert fold_name(unicodedata.normalize("NFC", text)) == fold_name(unicodedata.normalize("NFD", text))
