"""Edits of one element of MJCF: each returns whether there was something to edit."""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from math import hypot

import mujoco
import numpy as np

Change = Callable[[ET.Element], bool]
"""Edits an element; returns whether there was something to edit."""

HIDDEN = "left-out"
"""The tag of an element that is marked to be removed."""

SHAPES = {"sphere", "capsule", "cylinder", "box", "ellipsoid"}

AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}

ADVICE = {
    "damping": "", "stiffness": "", "armature": "", "frictionloss": "", "springref": "", "ref": "",
    "range": ", so that nothing limits it", "gear": ": MuJoCo's default is 1", "kp": ": MuJoCo's default is 1",
    "kv": "", "ctrlrange": ", so that nothing limits its control", "forcerange": ", so that nothing limits its force",
    "density": ": MuJoCo's default is that of water, 1000 kg/m^3", "pos": ": MuJoCo's default is 0 0 0",
    "quat": "", "euler": "", "axisangle": "", "friction": "", "contype": "", "conaffinity": "", "condim": "",
    "solref": "", "gravcomp": "", "axis": ": MuJoCo's default is 0 0 1", "margin": "",
    "polycoef": ": MuJoCo's default is 0 1 0 0 0",
}  # fmt: skip
"""Attributes that are left out, with what follows from it."""


def read(text: str) -> list[float]:
    """Returns the numbers of an attribute; none where one is no number."""
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []


def write(numbers: Sequence[float]) -> str:
    """Returns an attribute of numbers."""
    return " ".join(map(repr, numbers))


def drop(name: str) -> Change:
    """Removes an attribute."""
    return lambda element: element.attrib.pop(name, None) is not None


def rewrite(name: str, change: Callable[[list[float]], list[float]], default: str | None = None) -> Change:
    """Changes the numbers of an attribute; of one that is not there, those of the default, if there is one."""

    def edit(element: ET.Element) -> bool:
        numbers = read(element.get(name, default or ""))
        changed = change(numbers) if numbers else []
        if changed == numbers:
            return False
        element.set(name, write(changed))
        return True

    return edit


def multiply(name: str, factor: float, at: int | None = None, default: str | None = None) -> Change:
    """Multiplies the numbers of an attribute, or the one at a place."""
    return rewrite(
        name, lambda numbers: [value * factor if at in (None, i) else value for i, value in enumerate(numbers)], default
    )


def exchange(name: str, other: str) -> Change:
    """Gives each of two attributes the value of the other."""

    def edit(element: ET.Element) -> bool:
        mine, its = element.get(name), element.get(other)
        if mine is None or its is None or mine == its:
            return False
        element.attrib.update({name: its, other: mine})
        return True

    return edit


def rename(name: str, other: str) -> Change:
    """Gives another attribute the value of one, which is left out."""

    def edit(element: ET.Element) -> bool:
        if name not in element.attrib:
            return False
        element.set(other, element.attrib.pop(name))
        return True

    return edit


def rename_element(tag: str) -> Change:
    """Gives an element another tag."""

    def edit(element: ET.Element) -> bool:
        is_other, element.tag = element.tag != tag, tag
        return is_other

    return edit


def do_all(changes: Sequence[Change]) -> Change:
    """Makes several changes of an element."""

    def edit(element: ET.Element) -> bool:
        done = [change(element) for change in changes]
        return any(done)

    return edit


def do_either(tag: str, change: Change, other: Change) -> Change:
    """Makes one change of elements of a tag, and another one of all others."""
    return lambda element: (change if element.tag == tag else other)(element)


def put(name: str, value: str, beside: str = "") -> Change:
    """Sets an attribute, of an element that has another one where `beside` names it."""

    def edit(element: ET.Element) -> bool:
        if element.get(name) == value or (beside and beside not in element.attrib):
            return False
        element.set(name, value)
        return True

    return edit


def put_into(tag: str, name: str, value: str) -> Change:
    """Sets an attribute of the first element of a tag below the root, which is made if there is none."""

    def edit(root: ET.Element) -> bool:
        element = root.find(tag)
        return put(name, value)(ET.SubElement(root, tag) if element is None else element)

    return edit


def negate(name: str) -> Change:
    """Turns the sign of each number of an attribute round."""
    return multiply(name, -1)


def rotate(name: str, by: int) -> Change:
    """Writes the first numbers of an attribute last: of a quaternion w."""
    return rewrite(name, lambda numbers: numbers[by:] + numbers[:by])


def double_turn(element: ET.Element) -> bool:
    """Turns by twice the angle of a quaternion (w, v): to (w^2 - v^2, 2 w v)."""
    return rewrite("quat", lambda q: [q[0] ** 2 - sum(v * v for v in q[1:]), *(2 * q[0] * v for v in q[1:])])(element)


def turn_back(element: ET.Element) -> bool:
    """Turns by the same angle the other way."""
    return rewrite("quat", lambda q: [q[0], *(-v for v in q[1:])])(element)


def turn_about(axis: int) -> Change:
    """Turns by the angle of a quaternion about x, y or z; of one that is about one of the three."""

    def turn(quat: list[float]) -> list[float]:
        size = hypot(*quat[1:])
        return quat if max(map(abs, quat[1:])) < size else [quat[0], *(size if i == axis else 0.0 for i in range(3))]

    return rewrite("quat", turn)


def turn_place(quat: Sequence[float], sign: int) -> Change:
    """Turns a pos by a quaternion, or back."""
    by, turned = np.array([quat[0], *(sign * value for value in quat[1:])]), np.empty(3)

    def turn(pos: list[float]) -> list[float]:
        mujoco.mju_rotVecQuat(turned, np.array(pos), by / np.linalg.norm(by))
        return pos if np.allclose(turned, pos) else turned.tolist()

    return rewrite("pos", turn)


def widen_range(element: ET.Element) -> bool:
    """Multiplies the range of the control by the gear, which is left out."""
    gear = read(element.get("gear", ""))
    if not gear or gear == [1.0] or "ctrlrange" not in element.attrib:
        return False
    return drop("gear")(element) and multiply("ctrlrange", gear[0])(element)


def swap_ends(name: str) -> Change:
    """Turns the signs of a range round."""
    return rewrite(name, lambda ends: [-value for value in reversed(ends)])


def shift(name: str, by: Sequence[float]) -> Change:
    """Adds to the numbers of an attribute."""
    return rewrite(name, lambda numbers: [a + b for a, b in zip(numbers, by, strict=False)], default="0 0 0")


def stretch(element: ET.Element) -> bool:
    """Moves both ends of a fromto away from their middle, so that it is twice as long: what a full length in place of
    the half one makes of a geom whose pos is right."""
    return rewrite(
        "fromto", lambda ends: [1.5 * a - 0.5 * b for a, b in zip(ends, ends[3:] + ends[:3], strict=True)]
    )(element)  # fmt: skip


def invert_ratio(element: ET.Element) -> bool:
    """Writes one over the ratio of two joints: the second number of a polycoef."""
    return rewrite("polycoef", lambda numbers: [numbers[0], 1 / numbers[1], *numbers[2:]])(element)


def rename_to(name: str, other: str, value: str) -> Change:
    """Sets another attribute in place of one."""

    def edit(element: ET.Element) -> bool:
        if element.attrib.pop(name, None) is None:
            return False
        element.set(other, value)
        return True

    return edit


def scale_angles(factor: float, only: str = "") -> Change:
    """Multiplies the angles of an element, or those of one attribute: what `compiler angle` applies to."""

    def edit(element: ET.Element) -> bool:
        turns = element.tag == "joint" and element.get("type", "hinge") in ("hinge", "ball")
        names = [*(("range", "ref", "springref") if turns else ()), "euler"]
        changes = [multiply(name, factor) for name in names if only in ("", name)]
        if only in ("", "axisangle"):
            changes.append(multiply("axisangle", factor, 3))
        return do_all(changes)(element)

    return edit


def change_axis(to: str) -> Change:
    """Sets the axis of a joint to x, y or z, or turns its sign round."""

    def edit(element: ET.Element) -> bool:
        if element.get("type") in ("ball", "free"):
            return False
        if to == "-":
            return multiply("axis", -1, default="0 0 1")(element)
        if read(element.get("axis", "0 0 1")) == read(AXES[to]):
            return False
        element.set("axis", AXES[to])
        return True

    return edit


def become(tag: str) -> Change:
    """Makes an actuator one of another kind, without the attributes that this has not."""

    def edit(element: ET.Element) -> bool:
        known = {"motor": (), "position": ("kp", "kv"), "velocity": ("kv",)}[tag]
        element.tag = tag
        for name in {"kp", "kv", "dampratio", "timeconst"} - {*known}:
            element.attrib.pop(name, None)
        return True

    return edit


def hide(element: ET.Element) -> bool:
    """Marks an element that is left out."""
    element.tag = HIDDEN
    return True


def remove_hidden(root: ET.Element) -> None:
    """Removes the elements that are marked."""
    for parent in list(root.iter()):
        for child in [element for element in parent if element.tag == HIDDEN]:
            parent.remove(child)


def shift_inertia(element: ET.Element) -> bool:
    """Moves the inertia of an <inertial> from the centre of mass to the origin of the body: m (r^2 - r_i^2) more."""
    at = read(element.get("pos", "0 0 0"))
    squared, mass = sum(value * value for value in at), float(element.get("mass", "0"))
    moments = read(element.get("diaginertia", ""))
    shifted = [value + mass * (squared - r * r) for value, r in zip(moments, at, strict=True)]
    return put("diaginertia", write(shifted))(element)
