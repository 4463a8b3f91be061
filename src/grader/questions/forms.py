"""The forms of answers to exercises: a Python script, MJCF text, or a file; and the module that the jail imports."""

import base64
import binascii
import hashlib
import json
from dataclasses import dataclass
from typing import Literal

from grader.domain.run import SOURCE_BYTES_MAX
from grader.errors import InvalidAnswer, TooLarge, Unprocessable

Takes = Literal["python", "mjcf", "npz"]
"""What an exercise takes, as its author writes it."""

ENTRY = "answer"
"""The function of the module that returns MJCF or the bytes of a file, where the author names no other."""

MODULE = 'from base64 import b64decode\n\n\ndef {entry}(*arguments):\n    return b64decode("{text}"){decoded}\n'

BEGINNINGS = (b"PK", b"\x08")
"""How every .npz file begins, which is a zip file, and every .onnx file, whose first field is a version."""


@dataclass(frozen=True)
class Form:
    """What an answer is called, the file that holds it, and the key of its JSON. The text of one that `is_file` is the
    base64 of its bytes."""

    noun: str
    suffix: str
    media_type: str
    key: str
    shape: str
    empty: str
    others: tuple[str, ...] = ()

    @property
    def is_file(self) -> bool:
        """Whether the answer is a file, which no editor shows."""
        return self.key == "file"

    @property
    def suffixes(self) -> tuple[str, ...]:
        """How the files that are taken end, the usual one first."""
        return (self.suffix, *self.others)


FORMS: dict[Takes, Form] = {
    "python": Form(
        "script", ".py", "text/x-python", "source",
        'The answer to an exercise is {"source": "the text of your script"}.', "The script is empty.",
    ),
    "mjcf": Form(
        "model", ".xml", "text/xml", "source",
        'The answer to this exercise is {"source": "the MJCF of your model"}.', "The model is empty.",
    ),
    "npz": Form(
        "file", ".npz", "application/octet-stream", "file",
        'The answer to this exercise is {"file": "your .npz or .onnx file in base64"}.', "The file is empty.",
        (".onnx",),
    ),
}  # fmt: skip


def read_text(form: Form, answer: object) -> str:
    """Returns the text of an answer. Raises Unprocessable for another shape, TooLarge, and InvalidAnswer for nothing,
    for a file that is neither .npz nor .onnx, and for a text that is a notebook or none."""
    if not isinstance(answer, dict) or not isinstance(answer.get(form.key), str) or set(answer) - {form.key}:
        raise Unprocessable(form.shape)
    text: str = answer[form.key].removeprefix("\ufeff")  # editors put it there, and Python skips it in a file
    data = read_base64(form, text) if form.is_file else text.encode()
    if len(data) > SOURCE_BYTES_MAX:
        raise TooLarge(
            f"The {form.noun} is {len(data) // 1024} KB long; at most {SOURCE_BYTES_MAX // 1024} KB are taken."
        )
    if not data.strip():
        raise InvalidAnswer(form.empty)
    if form.is_file and not data.startswith(BEGINNINGS):
        raise InvalidAnswer("This is no .npz file and no .onnx file: write it with numpy.savez.")
    if "\0" in text:
        raise InvalidAnswer(f"This is no text: load the {form.noun} itself, not an archive of it.")
    if is_notebook(text):
        raise InvalidAnswer(
            "This is a notebook: hand in its code alone, which Jupyter saves with File, Save and Export Notebook As, "
            "Executable Script."
        )
    return text


def is_notebook(text: str) -> bool:
    """Whether a text is a Jupyter notebook."""
    if not text.lstrip().startswith("{"):
        return False
    try:
        return isinstance(notebook := json.loads(text), dict) and {"cells", "nbformat"} <= notebook.keys()
    except (ValueError, RecursionError):
        return False


def read_base64(form: Form, text: str) -> bytes:
    """Returns the bytes of a file. Raises Unprocessable for text that is no base64."""
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise Unprocessable(form.shape) from error


def write_module(takes: Takes, entry: str, text: str) -> str:
    """Returns the Python module that the jail imports for an answer: a script as it is; else one whose function `entry`
    returns the text, or the bytes of the file."""
    if takes == "python":
        return text
    is_file = FORMS[takes].is_file
    encoded = text if is_file else base64.b64encode(text.encode()).decode()
    return MODULE.format(entry=entry, text=encoded, decoded="" if is_file else ".decode()")


def decode_file(takes: Takes, data: bytes) -> str:
    """Returns the text of an answer that is read from a file. Raises UnicodeDecodeError."""
    return base64.b64encode(data).decode() if FORMS[takes].is_file else data.decode("utf-8-sig")


def describe_file(text: str) -> str:
    """Returns a line on a file: its size and digest; `text` may be anything."""
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        return "a file that cannot be read"
    return f"a file of {len(data) / 1024:.1f} KB, sha256 {hashlib.sha256(data).hexdigest()[:16]}"
