"""Every setting: read from the environment as GRADER_<NAME>, each with a default that works."""

import logging
import os
import sys
from pathlib import Path
from typing import Self
from urllib.parse import urlsplit

import structlog
from pydantic import Field, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

LOOPBACK = ("127.0.0.1", "localhost", "::1")


def default_content() -> Path:
    """The checkout that the package runs from, or else the current folder."""
    checkout = Path(__file__).resolve().parents[2]
    return checkout if (checkout / "quizzes").is_dir() else Path.cwd()


class Settings(BaseSettings):
    """How this installation runs."""

    model_config = SettingsConfigDict(env_prefix="GRADER_", frozen=True, extra="forbid")

    content: Path = Field(default_factory=default_content, description="Folder with quizzes/ and models/ inside.")
    data: Path = Field(default=Path(".data"), description="Folder of the SQLite database.")
    database_url: str | None = Field(
        default=None, description="postgresql://user@host/name for PostgreSQL; SQLite in the data folder if not given."
    )
    host: str = Field(default="127.0.0.1", description="Address to bind. Any but loopback needs public_origin.")
    port: int = Field(default=8000, ge=0, le=65535, description="Port to bind.")
    public_origin: str | None = Field(
        default=None, description="https://host[:port] under which learners reach the service, if not on loopback."
    )
    allowed_hosts: tuple[str, ...] = Field(
        default=(),
        description='Further names (without port) that requests may be addressed to, as JSON: ["a.example"].',
    )
    workers: int = Field(
        default_factory=lambda: len(os.sched_getaffinity(0)), ge=0, le=256,
        description="Scripts graded at the same time by this process; 0 leaves them to `grader worker`.",
    )  # fmt: skip
    allow_t2: bool = Field(
        default=False, description="Accept a jail without user namespaces, where the machine allows none."
    )
    lease_s: float = Field(default=60.0, gt=0, description="After how long a dead worker's job is taken again [s].")
    tries: int = Field(default=3, ge=1, description="How often a job is tried before it becomes a grader_fault.")
    rate_per_s: float = Field(default=60.0, gt=0, description="Requests that one user may make per second, lastingly.")
    rate_burst: int = Field(default=300, ge=1, description="Requests that one user may make at once.")
    body_kb: int = Field(default=2048, ge=1, description="Largest request body [KB].")
    queue_per_user: int = Field(default=100, ge=1, description="Scripts that one user may have waiting.")
    lab_cache_mb: int = Field(default=64, ge=0, description="Memory for lab runs that were asked for before [MB].")

    @model_validator(mode="after")
    def _only_https_beyond_loopback(self) -> Self:
        origin = urlsplit(self.public_origin or "")
        if self.public_origin is not None and (not origin.netloc or origin.path not in ("", "/") or origin.query):
            raise ValueError("public_origin is scheme://host[:port] and nothing else")
        if self.host not in LOOPBACK and origin.scheme != "https":
            raise ValueError(
                f"binding {self.host} shows the service to others: set GRADER_PUBLIC_ORIGIN=https://... first"
            )
        return self

    @property
    def is_local(self) -> bool:
        """Whether only this machine reaches the service: a learner then needs no name."""
        return self.host in LOOPBACK and self.public_origin is None

    @property
    def origin(self) -> str:
        """Where a browser finds the service: scheme, host and port."""
        if self.public_origin is not None:
            return self.public_origin.rstrip("/")
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}"

    @property
    def hosts(self) -> frozenset[str]:
        """Names that a request may be addressed to; any other is a page elsewhere that plays tricks with DNS."""
        public = urlsplit(self.public_origin or "").hostname
        return frozenset({*LOOPBACK, *self.allowed_hosts, *([public] if public else [])})

    @property
    def database(self) -> str:
        """URL of the database."""
        return self.database_url or f"sqlite:///{self.data / 'grader.db'}"


def log_to_stderr() -> None:
    """One line per event on stderr: stdout is for documents.

    Answers, tokens and sources are never logged: tracebacks come without the values of variables.
    """
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso"),
            structlog.dev.ConsoleRenderer(colors=False, exception_formatter=structlog.dev.plain_traceback),
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=lambda *_: structlog.PrintLogger(sys.stderr),
    )
