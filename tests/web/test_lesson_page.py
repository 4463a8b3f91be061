"""A lesson page with the author's text: quizzes and labs in their places, in a browser and without one."""

import json
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from grader.settings import Settings
from web.browsing import service

XML = '<mujoco><worldbody><body name="ball"><freejoint/><geom name="ball" size="1"/></body></worldbody></mujoco>'
LATER = {"id": "2-later", "title": "Later", "policy": {"opens": "2199-01-01T00:00:00Z"}}
MCQ = {"kind": "mcq", "q": "Which?", "options": ["a", "b"], "answer": 1, "whys": ["a is not.", "b is."]}
LABS = [{"id": name, "kind": "simlab", "title": f"The {name}", "model": "ball"} for name in ("fall", "rise")]
TEXT = """# Falling bodies

A ball falls by $g t^2 / 2$. <script>alert(1)</script> See [the end](#the-end).

```lab 2-check/fall
```

## Asked

```quiz 2-check
```

| case | time |
|---|---|
| low | 1 s |

```lab 2-later/secret
```

## The end

```python
print("no $x$ here")
```
"""


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A content folder with one lesson, a part of which is not open."""
    root = tmp_path_factory.mktemp("content")
    for folder in ("quizzes", "models", "lessons"):
        (root / folder).mkdir()
    (root / "models" / "ball.xml").write_text(XML)
    (root / "lessons" / "2.md").write_text(TEXT)
    later = {**LATER, "labs": [{**LABS[0], "id": "secret", "title": "Secret lab"}]}
    for quiz in ({"id": "2-check", "title": "A quiz", "questions": [MCQ], "labs": LABS}, later):
        (root / "quizzes" / f"{quiz['id']}.json").write_text(json.dumps(quiz))
    return root


@pytest.fixture(scope="module")
def origin(content: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The service with this content."""
    with service(Settings(data=tmp_path_factory.mktemp("data"), content=content, workers=0)) as origin:
        yield origin


def test_from_a_lesson_of_several_a_link_leads_to_all(tmp_path: Path) -> None:
    (tmp_path / "quizzes").mkdir()
    (tmp_path / "models").mkdir()
    for quiz in ("1-check", "2-check"):
        text = json.dumps({"id": quiz, "title": "A quiz", "questions": [MCQ]})
        (tmp_path / "quizzes" / f"{quiz}.json").write_text(text)
    with service(Settings(data=tmp_path, content=tmp_path, workers=0)) as origin:
        links = httpx.get(f"{origin}/lessons/1").text.partition("</nav>")[0]
    assert '<a href="/">Lessons</a>' in links
    assert '<a href="/lessons/1" aria-current="page">Lesson 1</a>' in links


def test_quizzes_and_labs_stand_where_the_author_put_them(origin: str) -> None:
    with httpx.Client(base_url=origin, follow_redirects=True) as client:
        client.post("/session", headers={"Sec-Fetch-Site": "same-origin"})
        page = client.get("/lessons/2")
    assert page.status_code == 200
    body = page.text[page.text.index("<main") :]
    marks = (
        "Lesson 2: Falling bodies", "<math", 'id="2-check--fall"', 'id="asked"', 'data-quiz="2-check"',
        'id="2-check--rise"', "<td>low</td>", "notice wait", 'id="the-end"', "no $x$ here",
    )  # fmt: skip
    places = [body.index(mark) for mark in marks]
    assert places == sorted(places)
    assert all(body.count(f'id="{name}"') == 1 for name in ("2-check--fall", "2-check--rise", "the-end"))
    assert "alert(1)" not in body
    assert "Secret lab" not in body
    assert ">Lessons</a>" not in page.text, "there is no other"
    assert '<a href="#asked">' in body
    assert len(page.content) < 60_000
