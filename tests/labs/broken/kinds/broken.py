"""Kinds of lab that must be refused; the files beside this module lack what each must have."""

from typing import Literal

from pydantic import BaseModel

from grader.labs import Lab, LabKind
from grader.labs.kinds.integrators import Integrators


class NoParts(Integrators):
    """Its template has no macro and no place for sentences; its script exports nothing, and imports from elsewhere."""


class Unnamed(Lab):
    """A model that leaves its names open."""


class Shouting(Lab):
    """A model whose name cannot stand in an address."""

    kind: Literal["../Lab"]


class NoNames(Integrators):
    """Authors cannot choose it."""

    lab = Unnamed  # type: ignore[assignment]


class NoAddress(Integrators):
    """Its script would have no address."""

    lab = Shouting  # type: ignore[assignment]


class NoLab(Integrators):
    """Its model is none."""

    lab = BaseModel  # type: ignore[assignment]


class NoSettings(Integrators):
    """What a learner sends cannot be read."""

    settings = BaseModel  # type: ignore[assignment]
    read = LabKind.read


class NoKind:
    """Not a kind at all."""


class Raises(Integrators):
    """Cannot be made."""

    def __init__(self) -> None:
        raise ZeroDivisionError
