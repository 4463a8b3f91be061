"""A server on a small content folder of its own, and clients with tokens."""

import json
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from databases import BACKENDS, database_url
from grader.app import create_app, issue_token
from grader.settings import Settings
from servers import serving

ROOT = Path(__file__).parents[2]

STIFFNESS = "model.actuator_gainprm[0] = value; model.actuator_biasprm[1] = -value"

QUIZ: dict[str, Any] = {
    "id": "small",
    "title": "A small quiz",
    "questions": [
        {"kind": "mcq", "q": "Which?", "options": ["a", "b", "c"], "answer": 1, "explain": "SECRET explain"},
        {"kind": "numeric", "q": "How long?", "answer": 5, "tol": 0.0625, "unit": "ms", "attempts": 2},
        {
            "kind": "predict",
            "q": "What then?",
            "options": ["up", "down"],
            "answer": 0,
            "sim": {
                "model": "pendulum_servo",
                "setup": "data.qpos[0] = 1.0",
                "controls": [
                    {"label": "step", "set": "model.opt.timestep", "min": 0.001, "max": 0.02, "step": 0.001,
                     "value": 0.01, "reset": True},
                    {"label": "stiffness", "apply": STIFFNESS, "min": 10, "max": 40000, "step": 10, "value": 100},
                ],
                "readouts": [{"label": "angle", "expr": "data.qpos[0]", "digits": 3}],
            },
        },
        {"kind": "open", "q": "Why?", "reference": "SECRET reference"},
    ],
    "labs": [{"id": "five", "kind": "integrators", "model": "double_pendulum", "key": 0, "seconds": 1}],
}  # fmt: skip


@dataclass
class Site:
    """A running server, and clients of it."""

    app: FastAPI
    settings: Settings
    origin: str
    course: str | None = None
    _clients: ExitStack = field(default_factory=ExitStack)

    def client(self, user: str, role: str = "student", course: str | None = None) -> httpx.Client:
        """A client that sends a new token of this user."""
        token = issue_token(self.settings, user, role, course or self.course)
        return self.anonymous({"Authorization": f"Bearer {token}"})

    def anonymous(self, headers: dict[str, str] | None = None) -> httpx.Client:
        """A client without a token."""
        return self._clients.enter_context(httpx.Client(base_url=self.origin, headers=headers, timeout=30))

    def close(self) -> None:
        self._clients.close()


@contextmanager
def open_site(settings: Settings) -> Iterator[Site]:
    app = create_app(settings)
    with serving(app) as origin:
        site = Site(app, settings, origin)
        try:
            yield site
        finally:
            site.close()
    app.state.context.database.close()


def write_content(folder: Path) -> Path:
    """A content folder with one quiz and the lesson's models."""
    (folder / "quizzes").mkdir(parents=True)
    shutil.copytree(ROOT / "models", folder / "models")
    (folder / "quizzes" / "small.json").write_text(json.dumps(QUIZ))
    return folder


@pytest.fixture
def content(tmp_path: Path) -> Path:
    """A content folder that a test may change."""
    return write_content(tmp_path / "content")


@pytest.fixture
def open_site_with(content: Path, tmp_path: Path) -> Iterator[Callable[..., Site]]:
    """Servers on a database of their own, with some settings changed."""
    with ExitStack() as sites:

        def open_it(**changes: Any) -> Site:
            settings = Settings(**{"content": content, "data": tmp_path / "data", "workers": 0, **changes})
            return sites.enter_context(open_site(settings))

        yield open_it


@pytest.fixture(scope="session")
def shared_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("site")
    with open_site(Settings(content=write_content(folder / "content"), data=folder / "data", workers=0)) as site:
        yield site


@pytest.fixture
def site(shared_site: Site) -> Site:
    """One server for all tests that do not change it; each test is a course of its own."""
    return replace(shared_site, course=f"course-{secrets.token_hex(4)}")


@pytest.fixture(scope="session", params=BACKENDS)
def either_shared_site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("either")
    with (
        database_url(request.param, folder) as url,
        open_site(Settings(content=write_content(folder / "content"), database_url=url, workers=0)) as site,
    ):
        yield site


@pytest.fixture
def either_site(either_shared_site: Site) -> Site:
    """A server on SQLite, and one on PostgreSQL."""
    return replace(either_shared_site, course=f"course-{secrets.token_hex(4)}")


@pytest.fixture
def ann(site: Site) -> httpx.Client:
    return site.client("ann")


@pytest.fixture
def bob(site: Site) -> httpx.Client:
    return site.client("bob")


@pytest.fixture
def teacher(site: Site) -> httpx.Client:
    return site.client("tina", "instructor")


@pytest.fixture
def nobody(site: Site) -> httpx.Client:
    return site.anonymous()
