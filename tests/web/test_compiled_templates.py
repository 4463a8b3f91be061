"""Compiled templates are kept between starts, and a folder that cannot be used costs time alone."""

from pathlib import Path

import pytest
from jinja2 import Environment

from grader.web.frame.rendering import CompiledTemplates, keep_compiled, templates


@pytest.fixture(autouse=True)
def _as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(templates.env, "bytecode_cache", None)


def start(monkeypatch: pytest.MonkeyPatch, folder: Path) -> list[str]:
    """Loads a page as after a start, and returns which templates were compiled."""
    compiled: list[str] = []
    compile_one = Environment.compile

    def note(self: Environment, source: str, name: str, *more: object) -> object:
        compiled.append(name)
        return compile_one(self, source, name, *more)  # type: ignore[call-overload]

    with monkeypatch.context() as patch:
        patch.setattr(Environment, "compile", note)
        keep_compiled(folder)
        templates.env.cache.clear()  # type: ignore[union-attr]
        templates.env.get_template("statistics.html")
    return compiled


def test_a_template_is_compiled_at_the_first_start_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert start(monkeypatch, tmp_path) == ["statistics.html"]
    assert start(monkeypatch, tmp_path) == []


def test_a_folder_that_is_gone_loses_nothing_but_time(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert start(monkeypatch, tmp_path / "gone") == ["statistics.html"]
    assert isinstance(templates.env.bytecode_cache, CompiledTemplates)


def test_nothing_is_kept_without_a_folder() -> None:
    keep_compiled(None)
    assert templates.env.bytecode_cache is None
