"""Installs kinds of exercises for one test."""

from typing import Any

import pytest

from grader.exercises import planning, rehearsing, runner


def install_kinds(monkeypatch: pytest.MonkeyPatch, **kinds: Any) -> None:
    """Lets these kinds alone be installed."""
    for module in (planning, rehearsing, runner):
        monkeypatch.setattr(module, "load_kinds", lambda: kinds)
