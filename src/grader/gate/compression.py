"""gzip, where it is safe."""

from starlette.middleware.gzip import GZipMiddleware
from starlette.types import ASGIApp, Receive, Scope, Send

BYTES_MIN = 1024
LEVEL = 6
"""Within 1 % of the size at 9, in three quarters of its time."""


class CompressionMiddleware(GZipMiddleware):
    """ASGI middleware for GET. Compresses answers, but for streams of events and pages whose address holds a code. The
    length of a compressed text tells how much of it repeats (BREACH). So whatever holds a new secret is sent as it is:
    links and tokens come in answers to POST, codes are in addresses. No other page holds a secret: sessions are in
    cookies alone, and forms need no token."""

    def __init__(self, app: ASGIApp) -> None:
        super().__init__(app, minimum_size=BYTES_MIN, compresslevel=LEVEL)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves the request."""
        holds_a_code = b"code=" in scope["query_string"]
        await (self.app if holds_a_code else super().__call__)(scope, receive, send)
