"""Parses the body of a form that has a file, which browsers send as multipart/form-data. Source: RFC 7578."""

import base64
import re
from email.message import Message
from email.parser import HeaderParser

from grader.errors import Unprocessable

BROKEN = "The form cannot be read: send it again."
HEADER_MAX = 1000
"""Longest headers that are read [characters]: the parser of email takes a time that grows with the square."""
BOUNDARY_MAX = 70
"""Longest boundary. Source: RFC 2046, section 5.1.1."""


def read_boundary(content_type: str) -> bytes | None:
    """Returns the boundary of a form with a file; None for any other form. Raises Unprocessable."""
    if len(content_type) > HEADER_MAX:
        raise Unprocessable(BROKEN)
    header = Message()
    header["Content-Type"] = content_type
    if header.get_content_type() != "multipart/form-data":
        return None
    boundary = str(header.get_param("boundary", ""))
    if not re.fullmatch(rf"[\x20-\x7e]{{1,{BOUNDARY_MAX}}}", boundary):
        raise Unprocessable(BROKEN)
    return boundary.encode()


def parse_multipart(body: bytes, boundary: bytes, fields_max: int) -> dict[str, list[str]]:
    """Returns the values of each field: the text of a field, the base64 of a file, empty where none was chosen. Raises
    Unprocessable for a body that is no such form, or has more than `fields_max` fields."""
    first, *parts = (b"\r\n" + body).split(b"\r\n--" + boundary)
    if first.strip() or not parts or not parts.pop().startswith(b"--") or len(parts) > fields_max:
        raise Unprocessable(BROKEN)
    fields: dict[str, list[str]] = {}
    for part in parts:
        head, separator, content = part.removeprefix(b"\r\n").partition(b"\r\n\r\n")
        if len(head) > HEADER_MAX:
            raise Unprocessable(BROKEN)
        header = HeaderParser().parsestr(head.decode(errors="replace"))
        name = header.get_param("name", header="Content-Disposition")
        if not separator or not isinstance(name, str):
            raise Unprocessable(BROKEN)
        is_file = header.get_filename() is not None
        value = base64.b64encode(content).decode() if is_file else content.decode(errors="replace").replace("\0", "")
        fields.setdefault(name, []).append(value)
    return fields
