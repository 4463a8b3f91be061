"""The reference of an exercise as a tree whose elements can be edited, and what they are called in sentences."""

import copy
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from grader.exercises.kinds.model.slips import Change, remove_hidden, shift

Element = ET.Element

RELATES = {("equality", "joint"), ("fixed", "joint"), ("spatial", "geom"), ("spatial", "site")}
"""Elements, by that around them, which have the tag of a part of a body and relate such parts."""

TENDONS = ("fixed", "spatial")

TARGETS = ("joint", "tendon", "site", "joint1", "body1")
"""Attributes that say what an element without a name is about."""


def name_kind(element: Element, around: str) -> str:
    """Returns what an element is, in words: its tag where that is the word."""
    if around == "equality":
        return "equality constraint"
    return "tendon" if element.tag in TENDONS else element.tag


@dataclass(frozen=True)
class Variant:
    """A model with one mistake, the sentence for who makes it, and the element that it is about, if it is one."""

    xml: str
    sentence: str
    tag: str = ""
    name: str = ""


class Reference:
    """The reference as a tree, whose elements are known by their place."""

    def __init__(self, text: str) -> None:
        self.root = ET.fromstring(text)  # noqa: S314 - the author's own file
        self.elements = list(self.root.iter())
        self.parents = {child: parent for parent in self.elements for child in parent}

    def find(self, *tags: str) -> list[Element]:
        """Returns the elements of these tags, in the order of the text, without those that only relate parts."""
        return [
            element
            for element in self.elements
            if element.tag in tags and (self.name_parent(element), element.tag) not in RELATES
        ]

    def find_in(self, tag: str) -> list[Element]:
        """Returns the elements directly within those of a tag, such as the constraints of <equality>."""
        return [element for element in self.elements if self.name_parent(element) == tag]

    def find_uses(self, tendon: Element) -> list[Element]:
        """Returns the actuators and sensors of a tendon, which cannot be without it."""
        return [element for element in self.elements if element.get("tendon", "") == tendon.get("name")]

    def name_parent(self, element: Element) -> str:
        """Returns the tag of the element around another; empty for the root."""
        parent = self.parents.get(element)
        return "" if parent is None else parent.tag

    def label(self, element: Element) -> str:
        """Returns what an element is called in a sentence: by its name, or by the body that it is in."""
        parent, around = self.parents.get(element), self.name_parent(element)
        if around in TENDONS and parent is not None:
            part = element.get(element.tag, "")
            return f'the {element.tag} "{part}" in {self.label(parent)}'
        kind = name_kind(element, around)
        if name := element.get("name"):
            return f'the {kind} "{name}"'
        if around == "body" and parent is not None and parent.get("name"):
            return f'the {kind} of the body "{parent.get("name")}"'
        if element.tag == "inertial" or parent is None:
            return f"the {kind}"
        on = next((at for name in TARGETS if (at := element.get(name))), None)
        if on:
            return f'the {kind} on "{on}"'
        return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"

    def edit(self, change: Change, elements: Sequence[Element], sentence: str) -> Iterator[Variant]:
        """Yields the model with a change of all of these elements, if there was something to change. The sentence may
        begin with a label."""
        places = [self.elements.index(element) for element in elements]
        root = copy.deepcopy(self.root)
        edited = list(root.iter())
        done = [change(edited[place]) for place in places]
        if any(done):
            remove_hidden(root)
            only = elements[0] if len(elements) == 1 else None
            named = ("", "") if only is None else (only.tag, only.get("name", ""))
            yield Variant(ET.tostring(root, encoding="unicode"), sentence[0].upper() + sentence[1:], *named)

    def exchange(self, name: str, one: Element, other: Element) -> Iterator[Variant]:
        """Yields the model in which two elements have each the other's value of an attribute, if these differ."""
        mine, its = one.get(name), other.get(name)
        if mine is None or its is None or mine == its:
            return
        root = copy.deepcopy(self.root)
        edited = list(root.iter())
        for element, value in ((one, its), (other, mine)):
            edited[self.elements.index(element)].set(name, value)
        sentence = f"The {name} of {self.label(one)} and that of {self.label(other)} are exchanged."
        yield Variant(ET.tostring(root, encoding="unicode"), sentence, one.tag, one.get("name", ""))

    def move_up(self, body: Element, by: Sequence[float]) -> str:
        """Returns the text in which a body hangs on the parent of its parent, its pos moved by these numbers."""
        root = copy.deepcopy(self.root)
        edited = list(root.iter())
        parents = {child: element for element in edited for child in element}
        moved = edited[self.elements.index(body)]
        parents[moved].remove(moved)
        parents[parents[moved]].append(moved)
        shift("pos", by)(moved)
        return ET.tostring(root, encoding="unicode")

    def edit_each(self, change: Change, elements: Sequence[Element], sentence: str) -> Iterator[Variant]:
        """Yields the model with a change of each element alone; `{}` of the sentence becomes what it is called."""
        for element in elements:
            yield from self.edit(change, [element], sentence.format(self.label(element)))

    def edit_both(self, change: Change, elements: Sequence[Element], sentence: str, each: str) -> Iterator[Variant]:
        """Yields the model with a change of all elements at once, and of each alone."""
        if len(elements) > 1:
            yield from self.edit(change, elements, sentence)
        yield from self.edit_each(change, elements, each)
