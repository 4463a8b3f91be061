"""No request keeps the event loop for long: every route with the worst bodies that it takes.

The processor time of each callback of the loop counts, which load on the machine does not change.
"""

import json
import time
from asyncio.events import Handle
from collections.abc import Iterator
from typing import Any

import pytest

from gate.test_rights import BODIES, UNLIMITED
from grader.gate.admission import LARGE_BODIES, PREFIX, SMALL_BODY_BYTES_MAX
from grader.settings import Settings
from support.sites import Site, open_site, write_content

pytestmark = pytest.mark.cost

HELD_S = 0.02
"""How long one callback may take [s]."""
LEAVES = {
    "list": ("[", "0,", "0]"),
    "objects": ("[", "{},", "{}]"),
    "pairs": ("{", '"{n}":1,', '"z":1}'),
    "texts": ("[", '"ab",', '"ab"]'),
    "nested": ("", "[", ""),
    "text": ('"', "a", '"'),
    "escapes": ('"', "\\u00e9", '"'),
    "number": ("", "1", ""),
    "decimals": ("1.", "1", ""),
}
"""JSON values of any length: the beginning, what is repeated, and the end."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("loop")
    content = write_content(folder / "content")
    with open_site(Settings(content=content, data=folder / "data", workers=0, **UNLIMITED), "asyncio") as site:
        yield site


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """How long callbacks of asyncio's event loops took [s]."""
    times: list[float] = []
    run = Handle._run

    def run_measured(handle: Handle) -> None:
        began = time.thread_time()
        run(handle)
        times.append(time.thread_time() - began)

    monkeypatch.setattr(Handle, "_run", run_measured)
    return times


def fill(name: str, size: int) -> str:
    """A JSON value of about `size` bytes."""
    before, unit, after = LEAVES[name]
    count = max(0, size - len(before) - len(after)) // len(unit)
    if name == "pairs":
        return before + "".join([unit.replace("{n}", f"{n:x}") for n in range(count)]) + after
    return before + unit * count + after


def worst_bodies(fields: dict[str, Any], size: int) -> Iterator[tuple[str, str]]:
    """Bodies of a size: every field holds each long value in turn, and a field that nobody knows, and all is one."""
    for name in LEAVES:
        yield name, fill(name, size)
        for key in [*fields, "unknown"]:
            others = "".join(f"{json.dumps(k)}: {json.dumps(v)}, " for k, v in fields.items() if k != key)
            yield f"{key}={name}", f"{{{others}{json.dumps(key)}: {fill(name, size - len(others) - 40)}}}"
    known = json.dumps(fields)[1:-1]
    yield "many keys", "{" + (known + ", " if known else "") + fill("pairs", size - len(known) - 20)[1:]


def properties(document: dict[str, Any], route: str) -> dict[str, Any]:
    """The fields that a route documents, each null."""
    method, path = route.split(" ")
    body = document["paths"][f"{PREFIX}{path}"][method.lower()].get("requestBody", {}).get("content", {})
    schema = body.get("application/json", {}).get("schema", {})
    for part in [schema, *schema.get("anyOf", [])]:
        if "$ref" in part:
            return dict.fromkeys(document["components"]["schemas"][part["$ref"].rpartition("/")[2]]["properties"])
    return {}


@pytest.mark.parametrize("route", BODIES)
def test_no_body_of_the_api_keeps_the_loop(route: str, site: Site, held: list[float]) -> None:
    client = site.client("robot", "service") if "/lms/" in route else site.client("tina", "instructor")
    document = site.anonymous().get("/openapi.json").json()
    method, path = route.split(" ")
    ids = dict.fromkeys(("quiz_id", "submission_id", "comment_id", "member_id"), "small") | {"platform_id": "1"}
    url = PREFIX + path.format_map(ids)
    fields = properties(document, route) | (BODIES[route] if isinstance(BODIES[route], dict) else {})
    headers = {"content-type": "application/json"}

    def hold_s(body: str) -> float:
        held.clear()
        assert client.request(method, url, content=body, headers=headers).status_code < 500
        return max(held)

    hold_s("{}")  # the first request of a route builds what others find
    worst = []
    sizes = {SMALL_BODY_BYTES_MAX: fields}
    if url in LARGE_BODIES:
        sizes[site.settings.body_kb * 1024] = {"answer": 1}
    for size, known in sizes.items():
        for name, body in worst_bodies(known, size):
            # What else the thread does now and then, such as collecting garbage, is not the body's.
            seconds = hold_s(body)
            worst.append((seconds if seconds < HELD_S else min(seconds, hold_s(body)), size, name))
    print(*(f"{1000 * s:.1f} ms {size} {name}" for s, size, name in sorted(worst)[-3:]), sep="\n")
    assert max(worst)[0] < HELD_S
