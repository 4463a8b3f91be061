"""Checks models: each compiles, and refers to no other file but models to attach, which become part of it."""

import ctypes
import re
import threading
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import mujoco

from grader.errors import Fault
from grader.library.checking.model_cost import explain_cost
from grader.library.json_text import join_key
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
    """Yield the elements of an MJCF text that refer to other files, each with the cure. MuJoCo would look for such a
    file in the working directory, and follow any path. Source: the XML reference; all attributes that name files begin
    with `file` (`fileup`, ...; `filename` in URDF). Raises ET.ParseError."""
    for element in ET.fromstring(xml).iter():  # noqa: S314 - the author's own file
        names = [value for name, value in element.attrib.items() if name.startswith("file") and value]
        if names or element.tag == "include":
            named = " ".join([element.tag, *([repr(element.attrib["name"])] if "name" in element.attrib else [])])
            cure = CURES.get(element.tag, "put it into the model itself")
            yield named, f"refers to {' and '.join(map(repr, names)) or 'another file'}: {cure}"


DECLARATION = re.compile(r"<!(?!--|\[CDATA\[)")
"""A document type or another declaration. MuJoCo's parser ends it at the first `>`, where XML may go on: it would read
elements, such as an include, that no parser of XML sees."""


def _other_file_faults(xml: str, file: str, key: str) -> list[Fault]:
    """Faults of an MJCF text that is not XML, or refers to other files."""
    if DECLARATION.search(xml):
        return [Fault(file, key, "does not compile: a model has no <!DOCTYPE ...> and no other <!...>: remove it")]
    try:
        uses = [f"<{element}> {why}" for element, why in _outside_files(xml)]
    except ET.ParseError as error:
        return [Fault(file, key, f"does not compile: not well-formed XML: {error}")]
    return [Fault(file, key, "a model may not use other files, but " + "; ".join(uses))] if uses else []


def model_faults(xml: str, file: str) -> list[Fault]:
    """Faults of a model: other files, or MuJoCo's own message if it does not compile."""
    if faults := _other_file_faults(xml, file, "model"):
        return faults
    if why := explain_cost(xml):
        return [Fault(file, "model", why)]
    prepare()
    try:
        mujoco.MjModel.from_xml_string(xml)
    except ValueError as error:
        return [_does_not_compile(file, error)]
    return []


def _does_not_compile(file: str, error: ValueError) -> Fault:
    return Fault(file, "model", "does not compile: " + " ".join(str(error).split()))


ATTACHED_MAX = 20
"""How many files a model may attach, itself or through others."""

DIGITS = 17
"""Significant digits of the numbers of a flattened model: as many as a double has."""

_writing = threading.Lock()


def flatten(xml: str, file: str, read: Callable[[str], str | Fault]) -> str | list[Fault]:
    """Returns the model with the models that it attaches written into it; the text itself where it attaches none.
    `read` gives the text of a file by its path in the content folder. The result compiles to the same model, bit for
    bit. Returns the faults of a model that cannot be read, or that does not compile."""
    attached: dict[str, str] = {}
    waiting = list(_attached_files(xml))
    while waiting:
        name = waiting.pop()
        if name in attached:
            continue
        text = read((Path(file).parent / name).as_posix())
        if isinstance(text, Fault):
            return [Fault(file, "model", f"attaches {name!r}, which {text.why}")]
        attached[name] = text
        waiting += _attached_files(text)
        if len(attached) > ATTACHED_MAX:
            return [Fault(file, "model", f"attaches more than {ATTACHED_MAX} files: write some of them here")]
    if not attached:
        return xml
    try:
        TopologicalSorter({name: _attached_files(text) for name, text in attached.items()}).prepare()
    except CycleError as error:  # MuJoCo would attach them without end, and crash
        return [Fault(file, "model", f"attaches {' in '.join(map(repr, error.args[1]))}: no model may contain itself")]
    others = [
        replace(fault, why=f"attaches {name!r}: {fault.why}" if name else fault.why)
        for name, text in {"": xml, **attached}.items()
        for fault in _other_file_faults(_without_models(text), file, "model")
    ]
    return others or _one_text(xml, file, attached)


def _one_text(xml: str, file: str, attached: dict[str, str]) -> str | list[Fault]:
    if why := explain_cost(xml, attached):
        return [Fault(file, "model", why)]
    prepare()
    try:
        spec = mujoco.MjSpec.from_string(xml, include={name: text.encode() for name, text in attached.items()})
        spec.compile()
        with _writing:
            return _written(spec)
    except ValueError as error:
        return [_does_not_compile(file, error)]


def _written(spec: mujoco.MjSpec) -> str:
    """The spec's MJCF with all digits. MuJoCo writes six unless told otherwise, which would change the model."""
    library = ctypes.CDLL(mujoco._functions.__file__)
    digits = library._mjPRIVATE__get_xml_precision()
    library._mjPRIVATE__set_xml_precision(DIGITS)
    try:
        text: str = spec.to_xml()
        return text
    finally:
        library._mjPRIVATE__set_xml_precision(digits)


def _models_in(root: ET.Element) -> Iterator[tuple[ET.Element, ET.Element]]:
    """Yields every `<model file=...>` of the assets, with the element that holds it."""
    for assets in root.iter("asset"):
        yield from ((assets, model) for model in assets.findall("model") if model.get("file"))


def _attached_files(xml: str) -> Iterator[str]:
    """Yields the files of the models that an MJCF text attaches; none of a text that is not XML."""
    try:
        root = ET.fromstring(xml)  # noqa: S314 - the author's own file
    except ET.ParseError:
        return
    yield from (model.attrib["file"] for _, model in _models_in(root))


def _without_models(xml: str) -> str:
    """The text without the models that it attaches, whose other references are to be told; itself if it is not XML."""
    try:
        root = ET.fromstring(xml)  # noqa: S314 - the author's own file
    except ET.ParseError:
        return xml
    for assets, model in list(_models_in(root)):
        assets.remove(model)
    return ET.tostring(root, encoding="unicode")


def inline_faults(raw: Any, file: str, key: str) -> Iterator[Fault]:
    """Faults of every `xml` in a question or lab, at any depth; an `xml` is a text or a list of lines."""
    items = raw.items() if isinstance(raw, dict) else enumerate(raw) if isinstance(raw, list) else ()
    for name, item in items:
        lines = item if isinstance(item, list) else [item]
        if name == "xml" and all(isinstance(line, str) for line in lines):
            yield from _inline_faults("\n".join(lines), file, join_key(key, name))
        elif not str(name).startswith("x-"):
            yield from inline_faults(item, file, join_key(key, name))


def _inline_faults(xml: str, file: str, key: str) -> list[Fault]:
    """Faults of one model inside a quiz; whether it compiles is found where it is used."""
    faults = _other_file_faults(xml, file, key)
    return faults or [Fault(file, key, f"the model {why}") for why in (explain_cost(xml),) if why]
