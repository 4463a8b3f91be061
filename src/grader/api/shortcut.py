"""A way past the routers and their layers for the few routes that must be fast."""

from collections.abc import Mapping, Sequence
from typing import Any

from starlette.middleware.exceptions import ExceptionMiddleware
from starlette.requests import Request
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send


class Shortcut:
    """ASGI middleware. Serves `routes`, which take POST at a fixed path and return a response, at once.

    To find their own routes takes FastAPI and its layers longer than these take to answer. Errors go to the same
    `handlers` as those of all other routes.
    """

    def __init__(self, app: ASGIApp, routes: Sequence[Route], handlers: Mapping[Any, Any]) -> None:
        self.app = app
        self._routes = {route.path: route for route in routes}
        self._short = ExceptionMiddleware(self._serve, handlers)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves the request."""
        is_ours = scope["type"] == "http" and scope["method"] == "POST" and scope["path"] in self._routes
        await (self._short if is_ours else self.app)(scope, receive, send)

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        route = scope["route"] = self._routes[scope["path"]]  # as routers do: the log and the metrics name it
        response = await route.endpoint(Request(scope, receive, send))
        await response(scope, receive, send)
