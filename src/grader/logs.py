"""Logs: one line per event on stderr, since stdout is for documents; as JSON, or as text for a person.

Answers, tokens, sources and queries are never logged: a request is named by the template of its route, tracebacks do
not show the values of variables, and only the type of an error that quotes its input.
"""

import asyncio
import json
import logging
import sys
import traceback
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import structlog

PROCESSORS: list[Any] = []
"""Of all loggers, which are kept from their first use on: to make one takes as long as a line."""

encode = json.JSONEncoder(default=str).encode
"""Made once: `json.dumps` makes an encoder for every line."""

BoundLogger = structlog.make_filtering_bound_logger(logging.INFO)


WAITING = deque[str]()
"""Lines that were logged in this step of an event loop; each is followed by a call of `write_lines`."""


class Lines:
    """Writes lines to stderr, whatever that is by then: in an event loop those of one step together, since a thread
    that writes lets all others go first, and then waits for its turn."""

    def msg(self, line: str) -> None:
        """Writes one line."""
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            write([line])
            return
        WAITING.append(line)
        loop.call_soon(write_lines)

    debug = info = warning = error = critical = exception = msg


def write_lines() -> None:
    """Writes the lines that wait, if any."""
    lines: list[str] = []
    with suppress(IndexError):  # other threads may have event loops too
        while True:
            lines.append(WAITING.popleft())
    if lines:
        write(lines)


def write(lines: Sequence[str]) -> None:
    """Writes lines to stderr, at once."""
    sys.stderr.write("".join(f"{line}\n" for line in lines))
    sys.stderr.flush()


def is_json(log_format: str) -> bool:
    """Whether `log_format` (json, text or auto) means JSON here; auto does unless stderr is a terminal."""
    return log_format == "json" or (log_format == "auto" and not sys.stderr.isatty())


def logs_json() -> bool:
    """Whether this process writes its log as JSON."""
    return structlog.get_config()["processors"][-1] is as_json_line


def log_to_stderr(*, as_json: bool = False, is_quiet: bool = False) -> None:
    """Configures the logs of this process, those of uvicorn included. Where it `is_quiet`, only warnings and worse."""
    steps: list[Any] = [
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso"),
        structlog.processors.ExceptionRenderer(exception_text),
    ]
    renderer: Any = as_json_line if as_json else structlog.dev.ConsoleRenderer(colors=False)
    PROCESSORS[:] = [*([drop_info] if is_quiet else []), *steps, renderer]
    structlog.configure(
        processors=PROCESSORS,
        wrapper_class=BoundLogger,
        logger_factory=lambda *_: Lines(),
        cache_logger_on_first_use=True,
    )
    handler = logging.StreamHandler()
    handler.setFormatter(structlog.stdlib.ProcessorFormatter(renderer, foreign_pre_chain=steps))
    uvicorn = logging.getLogger("uvicorn")
    uvicorn.handlers, uvicorn.propagate = [handler], False


def drop_info(_logger: Any, method: str, line: Any) -> Any:
    """Returns a line of a warning or worse; drops any other."""
    if method in ("debug", "info"):
        raise structlog.DropEvent
    return line


def as_json_line(_logger: Any, _method: str, line: Mapping[str, Any]) -> str:
    """A line of the log as JSON."""
    return encode(line)


def exception_text(exc_info: Any) -> str:
    """The tracebacks of an exception and of its causes, the first cause first."""
    parts: list[str] = []
    seen: set[int] = set()
    error: BaseException | None = exc_info[1]
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        # The messages of validation errors, pydantic's and others', hold what was validated: an answer, perhaps.
        message = "(its input is not shown)" if hasattr(error, "errors") else str(error)
        parts.append("".join(traceback.format_tb(error.__traceback__)) + f"{type(error).__name__}: {message}")
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return "\n\nled to\n\n".join(reversed(parts))
