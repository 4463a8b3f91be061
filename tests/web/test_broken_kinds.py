"""A kind of question of another package that fails costs its own card, and `grader check` tells its author."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from grader.errors import Fault
from grader.library import Library, load
from grader.questions import fill_form, kind_of, show_answer
from grader.settings import Settings
from grader.web.author import preview
from grader.web.author.preview import find_unshown
from grader.web.frame import rendering
from support.sites import Site, open_site, write_content

BROKEN = "{% macro field(base, it) %}{{ it.nothing.at_all }}{% endmacro %}"
NUMERIC = "numeric"


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_content(tmp_path_factory.mktemp("broken") / "content")


@pytest.fixture
def library(content: Path) -> Library:
    return load(content)


@pytest.fixture
def broken_template(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The template of the kind `numeric` refers to what its view does not have."""
    find, env = rendering.load_kind_template, rendering.templates.env
    name = f"kinds/{NUMERIC}.html"

    def load_template(wanted: str) -> Any:
        return (BROKEN, None, lambda: False) if wanted == name else find(wanted)

    loader: Any = env.loader
    monkeypatch.setattr(loader.loaders[1], "load_func", load_template)
    monkeypatch.setattr(env, "bytecode_cache", None)
    assert env.cache is not None
    env.cache.clear()
    yield
    env.cache.clear()


@pytest.mark.usefixtures("broken_template")
def test_the_rest_of_a_lesson_is_there(content: Path, tmp_path: Path) -> None:
    with open_site(Settings(content=content, data=tmp_path, workers=0)) as site:
        page = read_lesson(site)
    assert page.count("This question cannot be shown") == page.count(f'data-kind="{NUMERIC}"') + 1
    assert 'data-kind="mcq"' in page


def read_lesson(site: Site) -> str:
    learner = site.anonymous({"Accept": "text/html", "Sec-Fetch-Site": "same-origin", "Origin": site.origin})
    learner.post("/session")
    response = learner.get("/?quiz=small")
    assert response.status_code == 200
    return response.text


def find_all(library: Library) -> list[Fault]:
    return [*find_unshown(library, lambda _quiz, _question: True)]


@pytest.mark.usefixtures("broken_template")
def test_the_check_names_the_question_and_the_error(library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    assert find_all(library) == []  # the grader's own kinds have tests
    monkeypatch.setattr(preview, "is_own", lambda kind: False)
    faults = find_all(library)
    kinds = {question.id: question.kind for question in library.quizzes["small"].questions}
    assert [kinds[fault.key] for fault in faults] == [NUMERIC]
    assert "UndefinedError: " in faults[0].why


def test_an_answer_that_cannot_be_shown_is_told_as_it_is_stored(
    library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    question = library.question("small", "q1")

    def fail(*_: Any) -> str:
        raise RuntimeError

    for method in ("show", "to_form"):
        monkeypatch.setattr(type(kind_of(question)), method, fail)
    assert show_answer(question, {"at": [1, 2]}) == '{"at": [1, 2]}'
    assert show_answer(question, "two") == "two"
    assert fill_form(question, 1) == {}
