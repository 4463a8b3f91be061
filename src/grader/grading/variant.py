"""A model with other numbers: attributes of an MJCF text, found by element and name, set to new values."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping

from pydantic import Field

from grader.grading.parameters import Strict


class Number(Strict):
    """One number of a model: where it stands in the MJCF.

    `element` is a path of ElementTree below the root, such as `position[@name='servo']` or
    `body[@name='pendulum']/inertial`; `text` says how the number is written into the attribute.
    """

    element: str = Field(min_length=1)
    attribute: str = Field(min_length=1)
    text: str = Field(default="{}", pattern=r"^[^{}]*\{\}[^{}]*$")


def with_numbers(xml: str, numbers: Mapping[str, Number], values: Mapping[str, float]) -> str:
    """The MJCF text `xml` with `values` written in. Raises ValueError where a number has no place in the model."""
    try:
        root = ET.fromstring(xml)  # noqa: S314 - the author's own file
    except ET.ParseError as error:
        raise ValueError(f"the model is not XML: {error}") from error
    for name, value in values.items():
        if name not in numbers:
            raise ValueError(f"no number is called {name!r}; `numbers` has {', '.join(numbers) or 'none'}")
        place = numbers[name]
        found = places_of(root, name, place)
        if not found:
            raise ValueError(f"the model has no element {place.element} for the number {name!r}")
        for element in found:
            element.set(place.attribute, place.text.format(repr(float(value))))
    return ET.tostring(root, encoding="unicode")


def places_of(root: ET.Element, name: str, place: Number) -> list[ET.Element]:
    """The elements that hold a number. Raises ValueError where `element` is no path."""
    try:
        return root.findall(f".//{place.element}")
    except (SyntaxError, KeyError, TypeError, ValueError) as error:
        cure = "write it like body[@name='arm']/inertial"
        raise ValueError(f"numbers.{name}.element: {place.element!r} is no path; {cure}") from error
