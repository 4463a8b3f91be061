"""Checks models: each compiles, and refers to no other file."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Any

import mujoco

from grader.errors import Fault
from grader.library.json_text import dotted
from grader.numerics.process import prepare

CURES = {
    "include": "write its elements here",
    "mesh": "write its vertices here, as `vertex` and `face`, or take a `builtin` mesh",
    "hfield": "write its heights here, as `nrow`, `ncol` and `elevation`",
    "texture": "take a `builtin` texture",
    "model": "write its bodies here",
}
"""The cure for an element that refers to another file."""


def _outside_files(xml: str) -> Iterator[tuple[str, str]]:
    """Yield the elements of an MJCF text that refer to other files, each with the cure.

    MuJoCo would look for such a file in the working directory, and follow any path. Source: the XML reference; all
    attributes that name files begin with `file` (`fileup`, ...; `filename` in URDF). Raises ET.ParseError.
    """
    for element in ET.fromstring(xml).iter():  # noqa: S314 - the author's own file
        names = [value for name, value in element.attrib.items() if name.startswith("file") and value]
        if names or element.tag == "include":
            named = " ".join([element.tag, *([repr(element.attrib["name"])] if "name" in element.attrib else [])])
            cure = CURES.get(element.tag, "put it into the model itself")
            yield named, f"refers to {' and '.join(map(repr, names)) or 'another file'}: {cure}"


def _other_file_faults(xml: str, file: str, key: str) -> list[Fault]:
    """Faults of an MJCF text that is not XML, or refers to other files."""
    try:
        found = [f"<{element}> {why}" for element, why in _outside_files(xml)]
    except ET.ParseError as error:
        return [Fault(file, key, f"does not compile: not well-formed XML: {error}")]
    return [Fault(file, key, "a model may not use other files, but " + "; ".join(found))] if found else []


def model_faults(xml: str, file: str) -> list[Fault]:
    """Faults of a model: other files, or MuJoCo's own message if it does not compile."""
    if faults := _other_file_faults(xml, file, "model"):
        return faults
    prepare()
    try:
        mujoco.MjModel.from_xml_string(xml)
    except ValueError as error:
        return [Fault(file, "model", "does not compile: " + " ".join(str(error).split()))]
    return []


def inline_faults(raw: Any, file: str, key: str) -> Iterator[Fault]:
    """Faults of every `xml` in a question or lab, at any depth; an `xml` is a text or a list of lines."""
    items = raw.items() if isinstance(raw, dict) else enumerate(raw) if isinstance(raw, list) else ()
    for name, item in items:
        lines = item if isinstance(item, list) else [item]
        if name == "xml" and all(isinstance(line, str) for line in lines):
            yield from _other_file_faults("\n".join(lines), file, dotted(key, name))
        elif not str(name).startswith("x-"):
            yield from inline_faults(item, file, dotted(key, name))
