"""Routes are built with the first request that may be theirs, and whole to whoever asks."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest
from fastapi import APIRouter, FastAPI
from starlette.testclient import TestClient

from grader.gate.late_routes import LateRoute, page_router


def is_built(route: object) -> bool:
    return "dependant" in vars(route)


def build_router() -> APIRouter:
    router = APIRouter(route_class=LateRoute, prefix="/api")

    @router.get("/things/{name}")
    def read(name: str, size: int = 1) -> dict[str, int]:
        """Reads a thing."""
        return {name: size}

    @router.get("/others")
    def list_others() -> list[str]:
        return []

    return router


def test_a_request_builds_the_routes_that_begin_as_its_path_does() -> None:
    app, router = FastAPI(), build_router()
    app.routes.extend(router.routes)
    things, others = router.routes
    client = TestClient(app)
    assert client.get("/elsewhere").status_code == 404
    assert not is_built(things) and not is_built(others)
    assert client.get("/api/things/ball?size=2").json() == {"ball": 2}
    assert client.get("/api/things/ball?size=x").status_code == 422
    assert client.post("/api/things/ball").status_code == 405
    assert is_built(things) and not is_built(others)


def test_the_document_has_routes_that_nobody_has_asked_for() -> None:
    app = FastAPI()
    app.routes.extend([*build_router().routes, *page_router("/pages").routes])
    document = app.openapi()["paths"]
    assert document.keys() == {"/api/things/{name}", "/api/others"}
    assert document["/api/things/{name}"]["get"]["description"] == "Reads a thing."


def test_threads_that_ask_at_once_find_a_whole_route() -> None:
    threads = 8
    for _ in range(20):
        route, start = build_router().routes[0], Barrier(threads)

        def ask(_: int, route: object = route, start: Barrier = start) -> int:
            start.wait()
            return len(route.dependant.query_params)  # type: ignore[attr-defined]

        with ThreadPoolExecutor(threads) as pool:
            assert set(pool.map(ask, range(threads))) == {1}


def test_a_route_has_nothing_else() -> None:
    route = build_router().routes[0]
    with pytest.raises(AttributeError, match="colour"):
        _ = route.colour  # type: ignore[attr-defined]
