"""Answers HEAD as GET is answered, without a body: monitors and link checkers ask so."""

from starlette.types import Message, Receive, Scope, Send


def ask_as_get(scope: Scope, receive: Receive, send: Send) -> tuple[Scope, Receive, Send]:
    """Returns scope, receive and send of a GET in place of a HEAD: of its answer the head alone is sent, and a stream
    is ended as if its client had gone."""
    is_sent = False

    async def send_head(message: Message) -> None:
        nonlocal is_sent
        if message["type"] == "http.response.start":
            is_sent = True
            await send(message)
            await send({"type": "http.response.body"})

    async def receive_until_sent() -> Message:
        return {"type": "http.disconnect"} if is_sent else await receive()

    return {**scope, "method": "GET"}, receive_until_sent, send_head
