"""Makes a script's output safe to show: removes terminal commands, invisible and reordering characters."""

import json
import re
import unicodedata
from collections.abc import Callable
from typing import Any

# CSI and OSC sequences, then any other two-character escape. Source: ECMA-48.
ESCAPES = re.compile(
    r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]|(?:\x1b\]|\x9d)[^\x07\x1b\x9c]*(?:\x07|\x1b\\|\x9c)?|\x1b[ -/]*[0-~]"
)
NEWLINES = re.compile(r"\r\n?|[\x0b\x0c\x85\u2028\u2029]")
# Controls, formats (bidi among them), surrogates, private use, unassigned.
UNSHOWABLE = {"Cc", "Cf", "Cs", "Co", "Cn"}
REASON_CHARS_MAX = 300


def replace_hidden(text: str) -> str:
    """Replace every character that cannot be shown by U+FFFD."""
    text = NEWLINES.sub("\n", ESCAPES.sub("", text))
    bad = {c for c in set(text) if c not in "\n\t" and unicodedata.category(c) in UNSHOWABLE}
    return text.translate({ord(character): "\ufffd" for character in bad})


def clean(raw: bytes, bytes_max: int) -> str:
    """Decode the first `bytes_max` bytes; a character that cannot be shown becomes U+FFFD."""
    return replace_hidden(raw[:bytes_max].decode("utf-8", "replace"))


def clean_reason(text: str) -> str:
    """Clean a reason, put it on one line and cut it after 300 characters."""
    line = " ".join(replace_hidden(text).split())
    return line if len(line) <= REASON_CHARS_MAX else line[: REASON_CHARS_MAX - 1] + "…"


def read_json(raw: bytes) -> Any:
    """Read JSON that a script's process wrote; its texts are fit to be shown. An escape may stand for half of a
    surrogate pair, which no UTF-8 can hold. Raises ValueError and RecursionError."""
    return make_showable(json.loads(raw))


def make_showable(value: Any, show: Callable[[str], str] = replace_hidden) -> Any:
    """Return a value of JSON whose texts, and names, are as `show` returns them."""
    if isinstance(value, str):
        return show(value)
    if isinstance(value, list):
        return [make_showable(item, show) for item in value]
    if isinstance(value, dict):
        return {show(key): make_showable(item, show) for key, item in value.items()}
    return value
