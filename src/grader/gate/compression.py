"""gzip, where it is safe."""

from starlette.middleware.gzip import GZipMiddleware
from starlette.types import Receive, Scope, Send


class CompressionMiddleware(GZipMiddleware):
    """Compresses answers to GET, but for streams of events and pages whose address holds a code.

    The length of a compressed text tells how much of it repeats (BREACH). So whatever holds a new secret is sent as it
    is: links and tokens come in answers to POST, codes stand in addresses. No other page holds a secret: sessions are
    in cookies alone, and forms need no token.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves the request."""
        is_safe = scope["type"] == "http" and scope["method"] == "GET" and b"code=" not in scope["query_string"]
        await (super().__call__ if is_safe else self.app)(scope, receive, send)
