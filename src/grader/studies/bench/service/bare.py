"""Two bare routes that the service stands beside, written as a good engineer writes them in an afternoon: asynchronous,
with the server settings of the service. A route checks the shape of a body and stores it as one row before it answers.
It asks nobody who they are, grades nothing, and keeps no result.

`each` commits every row by itself; `gathered` stores the rows that wait together with one commit.
"""

import asyncio
import json
import secrets
import sqlite3
import sys
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import Any

import psycopg
import uvicorn
from fastapi import FastAPI
from pydantic import BaseModel

PATH = "/api/v1/submissions"
CONNECTIONS = 16
"""Connections to PostgreSQL of the route that commits each row: as many as the service keeps open."""
BATCH_MAX = 200

TABLE = "CREATE TABLE IF NOT EXISTS answers (id text PRIMARY KEY, body text NOT NULL)"

Row = tuple[str, str]
"""The id of an answer and its JSON text."""


class Answer(BaseModel):
    """The body of a request."""

    quiz: str
    question: str
    answer: Any


class Table(ABC):
    """A table that rows are stored in."""

    @abstractmethod
    async def open(self) -> None:
        """Connects, and creates the table."""

    @abstractmethod
    async def insert(self, rows: Sequence[Row]) -> None:
        """Inserts rows and commits them together: durably, with synchronous=FULL on SQLite, as PostgreSQL does."""


class InSqlite(Table):
    """A SQLite file, written by one thread."""

    def __init__(self, url: str) -> None:
        self._path, self._thread = url.removeprefix("sqlite:///"), ThreadPoolExecutor(1)

    async def open(self) -> None:
        """Connects, and creates the table."""
        await asyncio.get_running_loop().run_in_executor(self._thread, self._connect)

    async def insert(self, rows: Sequence[Row]) -> None:
        """Inserts rows in one transaction."""
        await asyncio.get_running_loop().run_in_executor(self._thread, self._store, rows)

    def _connect(self) -> None:
        self._connection = sqlite3.connect(self._path)
        self._connection.executescript(f"PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; {TABLE}")

    def _store(self, rows: Sequence[Row]) -> None:
        with self._connection:
            self._connection.executemany("INSERT INTO answers VALUES (?, ?)", rows)


class InPostgresql(Table):
    """A schema of PostgreSQL."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._free: asyncio.LifoQueue[psycopg.AsyncConnection[Any]] = asyncio.LifoQueue()

    async def open(self) -> None:
        """Connects, and creates the table."""
        for _ in range(CONNECTIONS):
            self._free.put_nowait(await psycopg.AsyncConnection.connect(self._url, autocommit=True))
        connection = await self._free.get()
        await connection.execute(TABLE)
        self._free.put_nowait(connection)

    async def insert(self, rows: Sequence[Row]) -> None:
        """Inserts rows with one statement, which is a transaction."""
        connection = await self._free.get()
        try:
            if len(rows) == 1:
                await connection.execute("INSERT INTO answers VALUES (%s, %s)", rows[0])
            else:
                columns = [list(column) for column in zip(*rows, strict=True)]
                await connection.execute("INSERT INTO answers SELECT * FROM unnest(%s::text[], %s::text[])", columns)
        finally:
            self._free.put_nowait(connection)


class Gathering(Table):
    """Stores the rows that wait with one commit, and meanwhile lets the next ones gather."""

    def __init__(self, table: Table) -> None:
        self._table = table
        self._waiting: asyncio.Queue[tuple[Row, asyncio.Future[None]]] = asyncio.Queue()

    async def open(self) -> None:
        """Connects, and begins to store."""
        await self._table.open()
        self._task = asyncio.create_task(self._store())

    async def insert(self, rows: Sequence[Row]) -> None:
        """Waits until the one row is committed."""
        stored = asyncio.get_running_loop().create_future()
        self._waiting.put_nowait((rows[0], stored))
        await stored

    async def _store(self) -> None:
        while True:
            batch = [await self._waiting.get()]
            while not self._waiting.empty() and len(batch) < BATCH_MAX:
                batch.append(self._waiting.get_nowait())
            await self._table.insert([row for row, _ in batch])
            for _, stored in batch:
                if not stored.done():
                    stored.set_result(None)


def open_table(commits: str, url: str) -> Table:
    """Returns the table at an address, which commits `each` row by itself or rows `gathered`."""
    table: Table = InSqlite(url) if url.startswith("sqlite:") else InPostgresql(url)
    return Gathering(table) if commits == "gathered" else table


def build_bare_app(table: Table) -> FastAPI:
    """Returns the route as an app."""

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        await table.open()
        yield

    app = FastAPI(lifespan=lifespan)

    @app.post(PATH, status_code=201)
    async def keep(answer: Answer) -> dict[str, Any]:
        answer_id, body = secrets.token_hex(16), answer.model_dump()
        await table.insert([(answer_id, json.dumps(body))])
        return {"id": answer_id, **body}

    return app


def serve_bare(commits: str, url: str, port: str) -> None:
    """Serves the route on the database of an address, with the server settings of the service."""
    app = build_bare_app(open_table(commits, url))
    uvicorn.run(app, port=int(port), log_level="warning", access_log=False, http="httptools", loop="uvloop")


if __name__ == "__main__":
    serve_bare(*sys.argv[1:])
