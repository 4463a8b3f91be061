"""What scripts print, made safe to show."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.sandbox.cleaning import REASON_CHARS_MAX, clean, clean_reason, read_json


@pytest.mark.parametrize(
    ("raw", "shown"),
    [
        (b"plain\ttext\n", "plain\ttext\n"),
        ("Ä° 漢字 🙂\n".encode(), "Ä° 漢字 🙂\n"),
        (b"\x1b[31mred\x1b[0m", "red"),
        (b"\x1b]0;title\x07x", "x"),
        (b"\x1b]8;;http://x\x1b\\link\x1b]8;;\x1b\\", "link"),
        (b"\x1bcreset", "reset"),
        (b"10 %\r20 %\r\n", "10 %\n20 %\n"),
        (b"a\x00b\x07", "a\ufffdb\ufffd"),
        ("\u202eevil\u2066".encode(), "\ufffdevil\ufffd"),
        (b"\xff\xfe", "\ufffd\ufffd"),
    ],
)
def test_known_cases(raw: bytes, shown: str) -> None:
    assert clean(raw, 1000) == shown


@given(st.binary(max_size=300))
def test_nothing_unshowable_is_left(raw: bytes) -> None:
    shown = clean(raw, 200)
    assert all(c in "\n\t" or unicodedata.category(c) not in ("Cc", "Cf", "Cs", "Co", "Cn") for c in shown)
    assert len(shown) <= 200


def test_the_texts_of_json_can_be_shown() -> None:
    raw = rb'{"a\ud800": ["\u202eb", 1.5, null, true, {"c": "\ud83d\ude42"}]}'
    assert read_json(raw) == {"a\ufffd": ["\ufffdb", 1.5, None, True, {"c": "🙂"}]}


@given(st.text(max_size=1000))
def test_a_reason_is_one_short_line(text: str) -> None:
    line = clean_reason(text)
    assert len(line) <= REASON_CHARS_MAX
    assert "\n" not in line


def test_an_unfinished_escape_costs_no_time() -> None:
    assert clean(b"\x1b[" * 100_000, 200_000) is not None
    assert clean(b"\x1b]" + b"x" * 200_000, 200_000) == ""
