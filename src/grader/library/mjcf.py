"""Models stand on their own: no MJCF of a content folder may refer to another file."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Any

import mujoco

from grader.errors import Fault
from grader.library.json_text import join
from grader.numerics.process import prepare

CURES = {
    "include": "write its elements here",
    "mesh": "write its vertices here, as `vertex` and `face`, or take a `builtin` mesh",
    "hfield": "write its heights here, as `nrow`, `ncol` and `elevation`",
    "texture": "take a `builtin` texture",
    "model": "write its bodies here",
}
"""How what another file holds is put into the model itself, by element."""


def outside_files(xml: str) -> Iterator[tuple[str, str]]:
    """Element and cure of everything in an MJCF text that is read from another file. Raises ET.ParseError.

    MuJoCo would look for such a file in the working directory, and follow it anywhere. Source: the XML reference; all
    attributes that name files begin with `file` (`fileup`, ...; `filename` in URDF).
    """
    for element in ET.fromstring(xml).iter():  # noqa: S314 - the author's own file
        names = [value for name, value in element.attrib.items() if name.startswith("file") and value]
        if names or element.tag == "include":
            named = " ".join([element.tag, *([repr(element.attrib["name"])] if "name" in element.attrib else [])])
            cure = CURES.get(element.tag, "put it into the model itself")
            yield named, f"refers to {' and '.join(map(repr, names)) or 'another file'}: {cure}"


def self_contained_faults(xml: str, file: str, key: str) -> list[Fault]:
    """What is wrong with an MJCF text before MuJoCo sees it: it is no XML, or refers to other files."""
    try:
        found = [f"<{element}> {why}" for element, why in outside_files(xml)]
    except ET.ParseError as error:
        return [Fault(file, key, f"does not compile: not well-formed XML: {error}")]
    return [Fault(file, key, "a model must stand on its own, but " + "; ".join(found))] if found else []


def model_faults(xml: str, file: str) -> list[Fault]:
    """Why a model cannot be used: other files, or why MuJoCo does not compile it, in its own words."""
    if faults := self_contained_faults(xml, file, "model"):
        return faults
    prepare()
    try:
        mujoco.MjModel.from_xml_string(xml)
    except ValueError as error:
        return [Fault(file, "model", "does not compile: " + " ".join(str(error).split()))]
    return []


def inline_faults(raw: Any, file: str, key: str) -> Iterator[Fault]:
    """The same for every `xml` in a question or lab, at any depth: a text, or a list of its lines."""
    items = raw.items() if isinstance(raw, dict) else enumerate(raw) if isinstance(raw, list) else ()
    for name, item in items:
        lines = item if isinstance(item, list) else [item]
        if name == "xml" and all(isinstance(line, str) for line in lines):
            yield from self_contained_faults("\n".join(lines), file, join(key, name))
        elif not str(name).startswith("x-"):
            yield from inline_faults(item, file, join(key, name))
