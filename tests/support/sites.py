"""Running servers for tests: a small content folder, the app on a free port, and clients with tokens."""

import json
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import httpx
from fastapi import FastAPI

from grader.courses.people.tokens import create_token
from grader.service.app import create_app
from grader.settings import Settings
from support.servers import PLAIN, serving

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
        with self.app.state.services.database.write() as session:
            token = create_token(session, user, role, course or self.course)
        return self.anonymous({"Authorization": f"Bearer {token}"})

    def anonymous(self, headers: dict[str, str] | None = None) -> httpx.Client:
        """A client without a token."""
        return self._clients.enter_context(
            httpx.Client(base_url=self.origin, headers=headers, timeout=30, verify=PLAIN)
        )

    def close(self) -> None:
        self._clients.close()


@contextmanager
def open_site(settings: Settings, loop: Literal["auto", "asyncio"] = "auto") -> Iterator[Site]:
    """The app on a free port."""
    app = create_app(settings)
    with serving(app, loop=loop) as origin:
        site = Site(app, settings, origin)
        try:
            yield site
        finally:
            site.close()
    app.state.services.database.close()


def write_content(folder: Path) -> Path:
    """A content folder with one quiz and the lesson's models."""
    (folder / "quizzes").mkdir(parents=True)
    shutil.copytree(ROOT / "models", folder / "models")
    (folder / "quizzes" / "small.json").write_text(json.dumps(QUIZ))
    return folder
