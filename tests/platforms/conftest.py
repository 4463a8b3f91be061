"""A server whose deliveries go to receivers on loopback."""

import secrets
from collections.abc import Iterator
from dataclasses import replace

import pytest
from sqlalchemy import delete

from grader.queue.jobs import JobRow
from grader.settings import Settings
from platforms.receivers import HERE
from platforms.working import database_of
from support.databases import BACKENDS, database_url
from support.sites import Site, open_site, write_content


@pytest.fixture(scope="module", params=BACKENDS)
def shared_site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("site")
    content = write_content(folder / "content")
    with (
        database_url(request.param, folder) as url,
        open_site(Settings(content=content, database_url=url, workers=0, private_hosts=(HERE,))) as site,
    ):
        yield site


@pytest.fixture
def site(shared_site: Site) -> Iterator[Site]:
    """One server on SQLite, and one on PostgreSQL; each test is a course of its own, and leaves no jobs."""
    yield replace(shared_site, course=f"course-{secrets.token_hex(4)}")
    with database_of(shared_site).write() as session:
        session.execute(delete(JobRow))
