"""Installs kinds of exercises for one test."""

from typing import Any

import pytest

from grader.exercises import luck, rehearsing, visible
from grader.exercises.running import authored, lazy, planning, runner


def install_kinds(monkeypatch: pytest.MonkeyPatch, **kinds: Any) -> None:
    """Lets these kinds alone be installed."""
    for module in (authored, lazy, luck, planning, rehearsing, runner, visible):
        monkeypatch.setattr(module, "load_kinds", lambda: kinds)
