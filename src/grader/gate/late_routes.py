"""Routes that FastAPI builds late: to read the signatures of all of them took a sixth of the start of a server."""

import threading
from collections.abc import Callable
from typing import Any

from fastapi import APIRouter
from fastapi.routing import APIRoute
from starlette.routing import Match
from starlette.types import Scope

_building = threading.RLock()


class LateRoute(APIRoute):
    """A route that is built as soon as anything but its path and endpoint is asked for: by the first request whose path
    begins as its own does, or by the OpenAPI document."""

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any) -> None:
        self.path, self.endpoint = path, endpoint
        self._start = path.partition("{")[0]
        self._options: dict[str, Any] | None = options

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        """Returns how far the route matches a request."""
        return super().matches(scope) if scope["path"].startswith(self._start) else (Match.NONE, {})

    def __getattr__(self, name: str) -> Any:
        """Returns what building the route sets, of which nothing is there before."""
        with _building:
            if options := vars(self).pop("_options", None):
                super().__init__(self.path, self.endpoint, **options)
        try:
            return vars(self)[name]
        except KeyError:
            raise AttributeError(name) from None


def page_router(prefix: str = "", route_class: type[LateRoute] = LateRoute) -> APIRouter:
    """Returns a router for pages, which the OpenAPI document does not describe."""
    return APIRouter(prefix=prefix, route_class=route_class, include_in_schema=False)
