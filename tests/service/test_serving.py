"""Responses leave the server in one write each."""

import asyncio
from typing import cast

import pytest

from grader.logs import Lines
from grader.service.serving import GATHERED_BYTES_MAX, GatheredWrites


class Transport:
    """Records what is written and closed, and how much of the log was written before."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self.calls: list[tuple[bytes | None, str]] = []
        self._capsys = capsys

    def write(self, data: bytes) -> None:
        self.calls.append((data, self._capsys.readouterr().err))

    def close(self) -> None:
        self.calls.append((None, ""))

    def is_closing(self) -> bool:
        return False


async def check_writes(capsys: pytest.CaptureFixture[str]) -> None:
    sent = Transport(capsys)
    gathered = GatheredWrites(cast(asyncio.Transport, sent))
    gathered.write(b"head ")
    Lines().msg("one")
    Lines().msg("two")
    gathered.write(b"body")
    assert sent.calls == []
    await asyncio.sleep(0)
    assert sent.calls == [(b"head body", "one\ntwo\n")]
    gathered.write(bytes(GATHERED_BYTES_MAX))  # a stream must not gather in memory
    assert len(sent.calls) == 2
    gathered.write(b"end")
    gathered.close()
    await asyncio.sleep(0)
    assert sent.calls[2:] == [(b"end", ""), (None, "")]
    assert not gathered.is_closing()


def test_a_response_is_sent_in_one_write_behind_its_line_of_the_log(capsys: pytest.CaptureFixture[str]) -> None:
    asyncio.run(check_writes(capsys))
