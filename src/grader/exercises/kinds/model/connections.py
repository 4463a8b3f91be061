"""Variants of what relates the parts of a reference: equality constraints, tendons with their actuators, contacts."""

from collections.abc import Iterator

from grader.exercises.kinds.model.reference_tree import TENDONS, Element, Reference, Variant
from grader.exercises.kinds.model.slips import do_all, drop, exchange, invert_ratio, multiply, put, read, rename_to

SOFT_S = (0.05, 0.1, 0.2, 0.5, 1)
"""Time constants [s] that people give a constraint which is to be softer than MuJoCo's of 0.02 s."""

FACTORS = ((-1, "of the wrong sign"), (2, "twice what was asked for"), (0.5, "half of what was asked for"))


def vary_connections(reference: Reference) -> Iterator[Variant]:
    """Ratios, joints and softness of equality constraints, coefficients of tendons, and what acts on a tendon."""
    constraints = reference.find_in("equality")
    for constraint in constraints:
        yield from vary_ratio(reference, constraint)
    for time_s in SOFT_S:
        sentence = "{} is softer than was asked for: the first number of its solref, a time constant, is too long."
        yield from reference.edit_each(put("solref", f"{time_s:g} 1"), constraints, sentence)
    for factor, text in FACTORS:
        sentence = f"The coef of {{}} is {text}."
        yield from reference.edit_each(multiply("coef", factor), reference.find_in("fixed"), sentence)
    yield from vary_transmissions(reference)


def vary_ratio(reference: Reference, constraint: Element) -> Iterator[Variant]:
    """Yields a constraint of two joints with another ratio. Where that is all of its polycoef, exchanged joints have
    the inverse ratio, so that one sentence must be true of both."""
    numbers = read(constraint.get("polycoef", "0 1 0 0 0"))
    if constraint.tag != "joint" or len(numbers) < 2:
        return
    if numbers[1] and not any((numbers[0], *numbers[2:])):
        sentence = (
            "{} has one over the ratio that was asked for: its polycoef gives joint1 as a function of joint2, so turn "
            "the ratio round, or exchange the two joints."
        )
        yield from reference.edit_each(invert_ratio, [constraint], sentence)
    else:
        sentence = "The joint1 and the joint2 of {} are exchanged: polycoef gives joint1 as a function of joint2."
    yield from reference.edit_each(exchange("joint1", "joint2"), [constraint], sentence)
    for factor, text in FACTORS:
        sentence = f"The ratio of {{}}, the second number of its polycoef, is {text}."
        yield from reference.edit_each(multiply("polycoef", factor, 1), [constraint], sentence)


def vary_transmissions(reference: Reference) -> Iterator[Variant]:
    """Yields actuators on a joint where a tendon was asked for, and on a tendon where a joint was."""
    joints = [name for joint in reference.find("joint") if (name := joint.get("name"))]
    tendons = [name for tendon in reference.find(*TENDONS) if (name := tendon.get("name"))]
    for actuator in reference.find_in("actuator"):
        label = reference.label(actuator)
        for own, other, names in (("tendon", "joint", joints), ("joint", "tendon", tendons)):
            for name in names if own in actuator.attrib else ():
                asked = actuator.get(own)
                sentence = f'{label} acts on the {other} "{name}", where the {own} "{asked}" was asked for.'
                yield from reference.edit(rename_to(own, other, name), [actuator], sentence)


def vary_contacts(reference: Reference) -> Iterator[Variant]:
    """Geoms that collide with nothing, or with what they should pass. Whether a geom or what it should touch is wrong
    cannot be told from where it falls, so that the sentences are true of both."""
    geoms = [geom for geom in reference.find("geom") if reference.name_parent(geom) == "body"]
    change = do_all([put("contype", "0"), put("conaffinity", "0")])
    yield from reference.edit_each(
        change, geoms, "{} collides with nothing: look at contype and conaffinity, its own and those of what it hits."
    )
    if len(geoms) > 1:
        sentence = "The geoms do not collide as they should: look at the contype and the conaffinity of each."
        yield from reference.edit(change, geoms, sentence)
    apart = [geom for geom in reference.find("geom") if {"contype", "conaffinity"} <= geom.attrib.keys()]
    yield from reference.edit_both(
        do_all([drop("contype"), drop("conaffinity")]), apart,
        'The geoms collide, where they should not: write contype="0" and conaffinity="0".',
        '{} collides, where it should not: write contype="0" and conaffinity="0".',
    )  # fmt: skip
