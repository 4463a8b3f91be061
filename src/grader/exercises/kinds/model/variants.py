"""Variants of a reference, each with one mistake that people make in MJCF. Each edits the text of the author's own
model, so that what a mistake gives is measured and not guessed."""

from collections.abc import Iterator
from itertools import combinations
from math import pi

from grader.exercises.kinds.model.connections import vary_connections, vary_contacts
from grader.exercises.kinds.model.reference_tree import TENDONS, Reference, Variant
from grader.exercises.kinds.model.slips import (
    ADVICE,
    AXES,
    SHAPES,
    become,
    change_axis,
    do_all,
    do_either,
    double_turn,
    drop,
    exchange,
    hide,
    multiply,
    negate,
    put,
    put_into,
    read,
    rename,
    rename_element,
    rotate,
    scale_angles,
    shift,
    shift_inertia,
    stretch,
    swap_ends,
    turn_about,
    turn_back,
    turn_place,
    widen_range,
)

LENGTHS = ("pos", "size", "fromto")
ANGLES = {
    "range": "The range of every joint that turns", "ref": "Every ref", "springref": "Every springref",
    "euler": "Every euler", "axisangle": "Every axisangle",
}  # fmt: skip
"""What the compiler reads in its unit of angles, with the words for all of a model."""
AS_RADIANS = (
    'is in radians, and the compiler reads degrees: convert it, or write <compiler angle="radian"/> and all angles in '
    "radians."
)
AS_DEGREES = (
    'is in degrees, and the compiler reads radians: convert it, or leave out angle="radian" and write all angles in '
    "degrees."
)
SENSORS = (
    ("jointpos", "jointvel", "jointactuatorfrc"), ("actuatorpos", "actuatorvel", "actuatorfrc"),
    ("tendonpos", "tendonvel"), ("accelerometer", "velocimeter", "gyro", "force", "torque"),
    ("framepos", "framequat", "framelinvel", "frameangvel", "framelinacc", "frameangacc"),
)  # fmt: skip
"""Sensors that take the same attributes."""
ACTUATORS = ("motor", "position", "velocity", "general", "damper", "intvelocity")


EXCHANGED = {
    "joint": ("damping", "armature", "stiffness", "range", "axis"),
    "geom": ("mass", "size"),
    **dict.fromkeys(ACTUATORS, ("joint", "gear", "kp", "kv", "ctrlrange")),
}
"""Attributes whose values two elements of one tag may have exchanged."""


def list_variants(text: str) -> Iterator[Variant]:
    """Yields the variants of a reference, the more frequent mistakes first."""
    reference = Reference(text)
    for family in (
        vary_angles, vary_options, vary_joints, vary_masses, vary_sizes, vary_actuators, vary_missing,
        vary_connections, vary_contacts, vary_tree, vary_shapes, vary_exchanged, vary_sensors, vary_places,
    ):  # fmt: skip
        yield from family(reference)


def vary_angles(reference: Reference) -> Iterator[Variant]:
    """Degrees and radians, and the order of a quaternion."""
    there = [name for name in ANGLES if any(name in element.attrib for element in reference.elements)]
    both = f"Every {' and every '.join(there)}"
    for factor, units in ((pi / 180, AS_RADIANS), (180 / pi, AS_DEGREES)):
        if len(there) > 1:
            yield from reference.edit(scale_angles(factor), reference.elements, f"{both} {units}")
        for name, every in ANGLES.items():
            some = [element for element in reference.elements if name in element.attrib]
            yield from reference.edit_both(
                scale_angles(factor, name), some, f"{every} {units}", f"The {name} of {{}} {units}"
            )
    for tag in ("position", "intvelocity"):
        which = "The ctrlrange of {} is in degrees: MuJoCo reads it in radians, whatever the compiler says."
        yield from reference.edit_each(multiply("ctrlrange", 180 / pi), reference.find(tag), which)
    turning = [element for element in reference.elements if "quat" in element.attrib]
    quat = "a quat is the cosine of half the angle, and the axis times its sine."
    for change, how in ((double_turn, "twice as far as"), (turn_back, "the other way than")):
        sentence = f"The orientation of {{}} is turned {how} was asked for: {quat}"
        yield from reference.edit_each(change, turning, sentence)
    for axis in range(3):
        yield from reference.edit_each(turn_about(axis), turning, "{} is turned about another axis than was asked for.")
    for body in turning:
        parts = [part for part in body if "pos" in part.attrib] if body.tag == "body" else []
        for sign in (-1, 1):
            frame = f"The pos of {{}} counts along the axes of {reference.label(body)}, which is turned."
            yield from reference.edit_each(turn_place(read(body.get("quat", "")), sign), parts, frame)
    turned = "of {} has its numbers in the order x y z w: MuJoCo's order is w x y z."
    yield from reference.edit_both(
        rotate("quat", 1), turning,
        "Every quat has its numbers in the order x y z w: MuJoCo's order is w x y z.", f"The quat {turned}",
    )  # fmt: skip


def vary_options(reference: Reference) -> Iterator[Variant]:
    """Gravity and other options of the simulation."""
    options = reference.find("option")
    if not options or "gravity" not in options[0].attrib:
        for value, sentence in (
            ("0 0 0", "There is no gravity: leave out its option, and it is 9.81 m/s^2 downwards."),
            ("0 0 9.81", "Gravity points upwards: MuJoCo's z axis points up, so it is 0 0 -9.81."),
            ("0 -9.81 0", "Gravity acts along y: MuJoCo's z axis points up, so it is 0 0 -9.81."),
        ):
            yield from reference.edit(put_into("option", "gravity", value), [reference.root], sentence)
    elif options:
        yield from reference.edit(negate("gravity"), options, "Gravity points the other way.")
    for element in options:
        for name in element.attrib:
            sentence = f"The option {name} is missing, so that MuJoCo's default holds."
            yield from reference.edit(drop(name), [element], sentence)
    yield from reference.edit(multiply("timestep", 1000), options, "The timestep is in milliseconds: MuJoCo's is in s.")
    for element in reference.find("flag"):
        for name in element.attrib:
            yield from reference.edit(drop(name), [element], f"The flag {name} is missing.")


def vary_joints(reference: Reference) -> Iterator[Variant]:
    """Axes, places and limits of joints."""
    joints = reference.find("joint")
    for axis in ("x", "y", "z"):
        sentence = f"is wrong: it is the {axis} axis of its body."
        others = [joint for joint in joints if read(joint.get("axis", "0 0 1")) != read(AXES[axis])]
        if len(others) == len(joints):
            yield from reference.edit_both(
                change_axis(axis), joints, f"The axis of every joint {sentence}", f"The axis of {{}} {sentence}"
            )
        else:
            yield from reference.edit_each(change_axis(axis), joints, f"The axis of {{}} {sentence}")
    yield from reference.edit_both(
        change_axis("-"), joints, "The axis of every joint points the other way: the sense of turning is wrong.",
        "The axis of {} points the other way: its sense of turning is wrong.",
    )  # fmt: skip
    for joint in joints:
        body = reference.parents.get(joint)
        if body is not None and body.tag == "body" and "pos" in body.attrib:
            sentence = (
                f"The pos of {reference.label(joint)} is that of its body: it is relative to the body that it is in."
            )
            yield from reference.edit(put("pos", body.get("pos", "")), [joint], sentence)
    yield from reference.edit_each(
        put("limited", "false", beside="range"), joints,
        "The range of {} is not in force: nothing limits it. Leave out limited=\"false\".",
    )  # fmt: skip
    yield from reference.edit_each(swap_ends("range"), joints, "The range of {} has the wrong signs.")
    for kind, other in (("hinge", "slide"), ("slide", "hinge")):
        some = [element for element in joints if element.get("type", "hinge") == kind]
        sentence = f"The joint {{}} is a {other}, where a {kind} was asked for.".replace("joint the joint", "joint")
        yield from reference.edit_each(put("type", other), some, sentence.replace("The joint {}", "{}"))


def vary_masses(reference: Reference) -> Iterator[Variant]:
    """Masses and inertias."""
    heavy = [element for element in reference.find("geom", "inertial") if "mass" in element.attrib]
    geoms = [element for element in heavy if element.tag == "geom"]
    yield from reference.edit_both(
        drop("mass"), geoms, "No geom has its mass, so that each has the density of water, 1000 kg/m^3.",
        "The mass of {} is missing, so that it has the density of water, 1000 kg/m^3.",
    )  # fmt: skip
    yield from reference.edit_both(
        rename("mass", "density"), geoms, "The mass of every geom is written as its density.",
        "The mass of {} is written as its density.",
    )  # fmt: skip
    yield from reference.edit_both(
        rename("density", "mass"), reference.find("geom"), "The density of every geom is written as its mass.",
        "The density of {} is written as its mass.",
    )  # fmt: skip
    for body in reference.find("body"):
        some = [element for element in body if element.tag == "geom" and "mass" in element.attrib]
        total = sum(float(element.get("mass", "0")) for element in some)
        if len(some) > 1:
            sentence = f"Each geom of {reference.label(body)} has the mass of the whole body: they add up."
            yield from reference.edit(put("mass", repr(total)), some, sentence)
    yield from reference.edit_both(
        multiply("mass", 1000), heavy, "Every mass is in grams: MuJoCo's unit is the kilogram.",
        "The mass of {} is in grams: MuJoCo's unit is the kilogram.",
    )  # fmt: skip
    yield from reference.edit_each(multiply("mass", 2), heavy, "The mass of {} is twice what was asked for.")
    yield from reference.edit_each(multiply("mass", 0.5), heavy, "The mass of {} is half of what was asked for.")
    yield from reference.edit_each(
        multiply("density", 1e-3), reference.find("geom"), "The density of {} is in g/cm^3: MuJoCo's is in kg/m^3."
    )
    for inertial in reference.find("inertial"):
        if "diaginertia" in inertial.attrib:
            about = "The inertia of {} is about the origin of the body: MuJoCo's is about the centre of mass."
            yield from reference.edit_each(shift_inertia, [inertial], about)
            order = "The three moments of inertia of {} are in another order: they are about x, y and z."
            for by in (1, 2):
                yield from reference.edit_each(rotate("diaginertia", by), [inertial], order)
        body = reference.parents[inertial]
        geom = next((each for each in body if each.tag == "geom"), None)
        if geom is not None:
            sentence = f"The mass of {reference.label(body)} is given to its geom, whose inertia is that of its shape."
            change = do_either("inertial", hide, put("mass", inertial.get("mass", "0")))
            yield from reference.edit(change, [inertial, geom], sentence)
        sentence = "The inertial is missing, so that mass and inertia come from the geoms."
        yield from reference.edit(hide, [inertial], sentence)


def vary_sizes(reference: Reference) -> Iterator[Variant]:
    """Half sizes, radii and millimetres."""
    geoms = [element for element in reference.find("geom", "site") if "size" in element.attrib]
    yield from reference.edit_both(
        multiply("size", 2), geoms, "Every size is the full one: MuJoCo's sizes are radii and half lengths.",
        "The size of {} is the full one: MuJoCo's sizes are radii and half lengths.",
    )  # fmt: skip
    for at, what in ((0, "radius"), (1, "half length")):
        full = "diameter" if at == 0 else "full length"
        some = [geom for geom in geoms if len(geom.get("size", "").split()) > at and geom.get("type") != "box"]
        for factor, wrong in (
            (2, f"the {full} in place of the {what}"),
            (0.5, f"half of the {what} that was asked for"),
        ):
            every, each = f"Every size has {wrong}.", f"The size of {{}} has {wrong}."
            yield from reference.edit_both(multiply("size", factor, at), some, every, each)
    yield from reference.edit_each(multiply("size", 0.5), geoms, "The size of {} is half of what was asked for.")
    long = [geom for geom in geoms if "fromto" in geom.attrib]
    yield from reference.edit_both(
        stretch, long, "Every geom is twice as long as was asked for: a size has half of the length, fromto all of it.",
        "{} is twice as long as was asked for: a size has half of the length, fromto all of it.",
    )  # fmt: skip
    if long:
        yield from reference.edit_both(
            do_all([multiply("size", 2), stretch]), geoms,
            "Every size is the full one: MuJoCo's sizes are radii and half lengths.",
            "The size of {} is the full one: MuJoCo's sizes are radii and half lengths.",
        )  # fmt: skip
    yield from reference.edit(
        do_all([multiply(name, 1000) for name in LENGTHS]), reference.elements,
        "Every length is in millimetres: MuJoCo's unit is the metre.",
    )  # fmt: skip
    for name in LENGTHS:
        some = [element for element in reference.elements if name in element.attrib]
        sentence = f"The {name} of {{}} is in millimetres: MuJoCo's unit is the metre."
        yield from reference.edit_each(multiply(name, 1000), some, sentence)


def vary_actuators(reference: Reference) -> Iterator[Variant]:
    """Gears, gains and kinds of actuators."""
    actuators = reference.find(*ACTUATORS)
    yield from reference.edit_each(
        multiply("gear", -1, default="1"),
        actuators,
        "{} acts the other way: the sign of its gear is wrong.",
    )
    for factor, text in ((10, "ten times"), (0.1, "a tenth of"), (2, "twice"), (0.5, "half of")):
        for name in ("gear", "kp", "kv"):
            yield from reference.edit_each(
                multiply(name, factor), actuators, f"The {name} of {{}} is {text} what was asked for."
            )
    yield from reference.edit_each(
        widen_range, actuators,
        "The gear of {} is 1, and its ctrlrange is multiplied in its place: keep the ctrlrange, and write the gear.",
    )  # fmt: skip
    for tag in ("motor", "position", "velocity"):
        others = [
            actuator
            for actuator in actuators
            if actuator.tag in ("motor", "position", "velocity") and actuator.tag != tag
        ]
        for element in others:
            text = f"{reference.label(element)} is a <{tag}>, where a <{element.tag}> was asked for."
            yield from reference.edit(become(tag), [element], text)
    yield from reference.edit_each(
        put("ctrllimited", "false", beside="ctrlrange"), actuators,
        "The ctrlrange of {} is not in force. Leave out ctrllimited=\"false\".",
    )  # fmt: skip


def vary_missing(reference: Reference) -> Iterator[Variant]:
    """What is left out: an attribute, a joint, an excluded pair."""
    for name, advice in ADVICE.items():
        some = [
            element
            for element in reference.elements
            if name in element.attrib and element.tag not in ("option", "inertial")
        ]
        yield from reference.edit_both(
            drop(name), some, f"The {name} is missing everywhere{advice}.", f"The {name} of {{}} is missing{advice}."
        )
    free = reference.find("freejoint")
    if len(free) > 1:
        yield from reference.edit(hide, free, "No body has its freejoint, so that nothing can move them.")
    for element in (*reference.find("joint", "freejoint", "exclude", *TENDONS), *reference.find_in("equality")):
        uses = reference.find_uses(element) if element.tag in TENDONS else []
        yield from reference.edit(hide, [element, *uses], f"{reference.label(element)} is missing.")


def vary_tree(reference: Reference) -> Iterator[Variant]:
    """Bodies that hang on the wrong parent, or whose place is given in the wrong frame."""
    for body in reference.find("body"):
        parent = reference.parents[body]
        if parent.tag != "body":
            continue
        label, above = reference.label(body), reference.label(parent)
        sentence = f"{label[0].upper()}{label[1:]} does not hang on {above}: write it inside that one's element."
        for by in ([0.0, 0.0, 0.0], read(parent.get("pos", "0 0 0"))):
            yield Variant(reference.move_up(body, by), sentence, "body", body.get("name", ""))
        by = read(parent.get("pos", "0 0 0"))
        sentence = "The pos of {} is given in the world: MuJoCo's is relative to the parent body."
        yield from reference.edit_each(
            shift("pos", by),
            [body], sentence,
        )  # fmt: skip


def vary_shapes(reference: Reference) -> Iterator[Variant]:
    """Geoms of another type."""
    for element in reference.find("geom"):
        for kind in SHAPES - {element.get("type", "sphere")}:
            sentence = f"{reference.label(element)} is a {kind}, where a {element.get('type', 'sphere')} was asked for."
            yield from reference.edit(put("type", kind), [element], sentence)


def vary_exchanged(reference: Reference) -> Iterator[Variant]:
    """Values that stand in the place of others: the gains of a servo, another joint of an actuator, the same attribute
    of two elements."""
    actuators = reference.find(*ACTUATORS)
    yield from reference.edit_each(exchange("kp", "kv"), actuators, "The kp and the kv of {} are exchanged.")
    joints = [name for joint in reference.find("joint") if (name := joint.get("name"))]
    for actuator in actuators:
        label, own = reference.label(actuator), actuator.get("joint")
        for name in joints if own else ():
            sentence = f'{label} acts on the joint "{name}", where "{own}" was asked for.'
            yield from reference.edit(put("joint", name), [actuator], sentence)
    for tag, names in EXCHANGED.items():
        for one, other in combinations(reference.find(tag), 2):
            for name in names:
                yield from reference.exchange(name, one, other)


def vary_sensors(reference: Reference) -> Iterator[Variant]:
    """Sensors of something else, or of another joint."""
    joints = [name for joint in reference.find("joint") if (name := joint.get("name"))]
    for alike in SENSORS:
        for sensor in reference.find(*alike):
            name, own = sensor.get("name"), sensor.get("joint")
            label = f'The sensor "{name}"' if name else f"A <{sensor.tag}>"
            for tag in alike:
                sentence = f"{label} is a <{tag}>, where a <{sensor.tag}> was asked for."
                yield from reference.edit(rename_element(tag), [sensor], sentence)
            for joint in joints if own else ():
                sentence = f'{label} is on the joint "{joint}", where "{own}" was asked for.'
                yield from reference.edit(put("joint", joint), [sensor], sentence)


def vary_places(reference: Reference) -> Iterator[Variant]:
    """One coordinate of a place that is halved, doubled, left out, or has the wrong sign."""
    placed = [element for element in reference.elements if "pos" in element.attrib]
    for at, axis in enumerate("xyz"):
        for factor, text in (
            (0.5, "half of what was asked for"), (2, "twice what was asked for"), (0, "0, where another was asked for"),
            (-1, "of the wrong sign"),
        ):  # fmt: skip
            yield from reference.edit_each(
                multiply("pos", factor, at), placed, f"The {axis} in the pos of {{}} is {text}."
            )
