"""Finds the installed kinds of lab, and validates authors' JSON of any of them."""

import inspect
import re
from collections.abc import Iterator, Mapping
from functools import cache, reduce
from importlib.metadata import EntryPoint
from operator import or_
from pathlib import Path
from typing import Annotated, Any

from pydantic import Discriminator, GetCoreSchemaHandler, Tag, TypeAdapter
from pydantic_core import CoreSchema

from grader.domain.lab import Lab, LabConfig, UnknownLab
from grader.domain.plugins import find_points, load_point
from grader.errors import PluginError
from grader.labs.kind import SCRIPT, TEMPLATE, LabKind, LabSettings

GROUP = "grader.lab_kinds"
"""The entry-point group in which kinds of lab are found."""

DEFAULT = "simlab"
"""The kind of a lab that names none."""

UNKNOWN = "unknown"
"""What errors of pydantic call a lab of a kind that is not installed."""

NAME = re.compile(r"[a-z][a-z0-9-]{0,39}")
"""Names of kinds stand in addresses."""

IMPORTED = re.compile(r"""(?:\bimport|\bfrom)\s*\(?\s*["'`]([^"'`]+)""")
NEIGHBOUR = re.compile(r"\.\./[a-z0-9-]+\.js")
"""What a script may import: the modules of the service's own pages."""

AnyLabKind = LabKind[Any, Any]


@cache
def lab_kinds() -> Mapping[str, AnyLabKind]:
    """Returns every installed kind by each of its names, in the order of the names of the entry points. Raises
    PluginError if two kinds claim one name, or if a kind cannot be loaded or is not whole."""
    kinds: dict[str, AnyLabKind] = {}
    for point in sorted(find_points(GROUP)):
        kind = load_lab_kind(point)
        for name in kind.names:
            if name in kinds:
                what = f"two installed kinds of lab are called {name!r}, one of them in {point.value}"
                raise PluginError(f"{what}: remove one")
            kinds[name] = kind
    if DEFAULT not in kinds:
        raise PluginError(f"the kind of lab {DEFAULT!r} is not installed: install the grader again (`make install`)")
    return kinds


def load_lab_kind(point: EntryPoint) -> AnyLabKind:
    """Makes the kind of an entry point. Raises PluginError."""
    kind: AnyLabKind = load_point(point, "lab kind")
    if faults := "; ".join(list_lacks(kind)):
        raise PluginError(f"the lab kind {point.name!r} ({point.value}) is not whole: {faults}")
    return kind


def list_lacks(kind: Any) -> Iterator[str]:
    """Yields what a kind lacks, with the cure."""
    if not isinstance(kind, LabKind):
        yield "derive it from grader.labs.LabKind"
        return
    model = getattr(kind, "lab", None)
    if not (isinstance(model, type) and issubclass(model, Lab)):
        yield "set `lab` to a model that derives from grader.labs.Lab"
    elif not kind.names:
        yield f"declare `kind: Literal[...]` in {model.__name__}, with the names that authors write"
    elif wrong := [name for name in kind.names if name == UNKNOWN or not NAME.fullmatch(name)]:
        yield f"rename {wrong[0]!r}: a name begins with a letter, and has small letters, digits and dashes"
    settings = getattr(kind, "settings", None)
    is_read_here = type(kind).read is LabKind.read
    if is_read_here and not (isinstance(settings, type) and issubclass(settings, LabSettings)):
        yield "set `settings` to a model that derives from grader.labs.LabSettings"
    yield from _list_lacking_files(kind)


def _list_lacking_files(kind: AnyLabKind) -> Iterator[str]:
    """Yields what the template and the script of a kind lack."""
    template, script = (_read_beside(kind, name) for name in (TEMPLATE, SCRIPT))
    if template is None:
        yield f"put a template with its parts at {template_of(kind)}"
    for macro in ("skeleton(base, lab)", "still(lab)") if template is not None else ():
        if f"macro {macro}" not in str(template):
            yield f"define the macro {macro} in {template_of(kind)}"
    if template is not None and "data-message" not in template:
        yield f"give sentences for the learner a place in {template_of(kind)}: an element with data-message"
    if script is None:
        yield f"put an ES module that draws it at {script_of(kind)}"
        return
    if not re.search(r"^export (?:async )?function open\(", script, re.MULTILINE):
        yield f"export a function `open(box, page)` from {script_of(kind)}"
    for address in IMPORTED.findall(script):
        if not NEIGHBOUR.fullmatch(address):
            yield f"import {address!r} in {script_of(kind)} as a module of the pages, such as '../chart.js'"


def _read_beside(kind: AnyLabKind, name: str) -> str | None:
    """Returns the text of a file beside the module of a kind; None where there is none that is UTF-8."""
    try:
        return _find_beside(kind, name).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None


def _find_beside(kind: AnyLabKind, name: str) -> Path:
    return Path(inspect.getfile(type(kind))).with_name(name)


def template_of(kind: AnyLabKind) -> Path:
    """Returns where the template of a kind is: beside its module."""
    return _find_beside(kind, TEMPLATE)


def script_of(kind: AnyLabKind) -> Path:
    """Returns where the script of a kind is: beside its module."""
    return _find_beside(kind, SCRIPT)


def name_lab_kind(lab: Any) -> str:
    """Returns the kind that the JSON of a lab, or a lab, names; the `sim` of a question names none."""
    kind = lab.get("kind", DEFAULT) if isinstance(lab, Mapping) else getattr(lab, "kind", DEFAULT)
    return str(kind)


def lab_kind_of(lab: Lab | LabConfig) -> AnyLabKind:
    """Returns the kind of a lab, or of the `sim` of a question."""
    return lab_kinds()[name_lab_kind(lab)]


def _find_tag(lab: Any) -> str:
    """Says which model a lab is validated by."""
    name = name_lab_kind(lab)
    return name if name in lab_kinds() else UNKNOWN


def lab_type() -> Any:
    """Returns the type of a lab of any kind, for pydantic."""
    models = {name: kind.lab for name, kind in lab_kinds().items()} | {UNKNOWN: UnknownLab}
    tagged = [Annotated[model, Tag(name)] for name, model in models.items()]
    return Annotated[reduce(or_, tagged), Discriminator(_find_tag)]


@cache
def lab_adapter() -> TypeAdapter[Lab | UnknownLab]:
    """Returns what validates and dumps a lab of any kind."""
    return TypeAdapter(lab_type())


class _OfInstalledKinds:
    """Validates a field of a model as a lab of any installed kind. Such a model sets `defer_build`."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Returns the schema of all kinds, which are loaded here for the first time."""
        return handler.generate_schema(lab_type())


AnyLab = Annotated[Lab | UnknownLab, _OfInstalledKinds()]
