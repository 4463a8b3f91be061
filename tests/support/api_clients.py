"""A server on a small content folder of its own, and clients with tokens."""

import secrets
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from grader.settings import Settings
from support.databases import BACKENDS, database_url
from support.sites import Site, open_site, write_content


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


@pytest.fixture(scope="module")
def shared_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("site")
    with open_site(Settings(content=write_content(folder / "content"), data=folder / "data", workers=0)) as site:
        yield site


@pytest.fixture
def site(shared_site: Site) -> Site:
    """One server for all tests that do not change it; each test is a course of its own."""
    return replace(shared_site, course=f"course-{secrets.token_hex(4)}")


@pytest.fixture(scope="module", params=BACKENDS)
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
