"""What a failed policy may have been meant as: the same weights, used as another convention would use them. Each is run
over failed episodes; the first that reaches the goals names the mistake."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import mujoco
import numpy as np

from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import Floats, list_widths
from grader.exercises.kinds.policy.network import ACTIVATIONS, Network, list_limits
from grader.exercises.kinds.policy.parameters import PolicyParameters

Act = Callable[[Floats], Floats]

PERIODS = (2.0, 0.5, 4.0, 0.25, 5.0, 0.2, 10.0, 0.1)
"""Control periods that are tried, as multiples of the declared one."""

WIDTH_MAX = 12
"""Observations up to which every exchange of two, and every sign, is tried."""

TINY = 1e-300
"""A std of less is taken for this one where it is inverted."""

SIGNS_MAX = 6
"""Observations up to which the signs of every two are tried."""

TRANSPOSED = (
    "The policy works with {names} transposed: PyTorch's nn.Linear keeps its weight as (out, in), and here x @ W is "
    "computed. Save layer.weight.T."
)
RESHAPED = (
    "A reshape has mixed up the numbers of {names}: the policy works with transposed weights. Save layer.weight.T, not "
    "layer.weight.reshape."
)
ACTIVATION = (
    "The policy works with {used} between its layers, and this exercise runs it with {declared}: train with {declared}."
)
VARIANCE = "The policy works with the square root of std: save the standard deviation as std, not the variance."
INVERSE = "The policy works with 1 / std: save the standard deviation as std, not its inverse."
TWICE = (
    "The policy works without the mean and std of the file: what is observed is normalised twice. Leave them out, or "
    "keep the weights as they were trained."
)
MISSING = (
    "The policy works on normalised observations: save the mean and std of the training in the file, as mean and std."
)
SHARES = (
    "The policy works if its outputs are shares of the actuators' ranges, from -1 to 1; this exercise takes them as "
    "controls. Multiply the last layer by half the range before you save it."
)
UNIT_SHARES = (
    "The policy works if its outputs are shares of the actuators' ranges from 0 to 1, the lower end to the upper one. "
    "Convert the last layer before you save it."
)
REST = (
    "The policy works once the constant part of its controls, those where every observation is 0, is divided by "
    "{number}, the number of actuators: each of them may have got the whole of it."
)
CONTROLS = (
    "The policy works if its outputs are controls; this exercise takes them as shares of the actuators' ranges, from "
    "-1 to 1. Divide the last layer by half the range before you save it."
)
SQUASHED = "The policy works with a tanh behind its last layer, and this exercise runs it without."
UNSQUASHED = "The policy works without the tanh behind its last layer, which this exercise runs: train with it."
ORDER = (
    "The policy works if it observes {found}, in this order; the exercise tells it {declared}. Exchange the rows of W1."
)
SIGN = "The controls have the wrong sign: the policy works once they are negated."
SIGN_OF = "The policy takes {name} with the opposite sign: it works once this observation is negated."
SIGNS_OF = "The policy takes {names} with the opposite sign: it works once both observations are negated."
DEGREES = (
    "The policy works on angles in degrees, and it observes radians: train on radians, or multiply the rows of W1 that "
    "belong to angles by 180/pi."
)
OUTPUTS = "The policy works once its controls are exchanged: the order of the model's actuators is {declared}."
SLOWER = "The policy works if it is asked less often: train it with the control period of this exercise."
FASTER = "The policy works if it is asked more often: train it with the control period of this exercise."


@dataclass(frozen=True)
class Variant:
    """Another use of the same weights, and the sentence where it works. `period` is a multiple of the declared control
    period."""

    sentence: str
    act: Act
    period: float = 1.0


def list_variants(parameters: PolicyParameters, problem: Problem, network: Network) -> Iterator[Variant]:
    """Yields every other use of the weights, the most likely first."""
    yield from list_transposed(network)
    yield from list_scaled(parameters, problem, network)
    yield from list_normalised(parameters, network)
    yield Variant(SIGN, lambda seen: 2 * find_middle(network) - network.act(seen))
    yield from list_ordered(parameters, problem, network)
    yield from list_in_degrees(parameters, problem, network)
    for name in ACTIVATIONS:
        if name != network.activation and len(network.layers) > 1:
            sentence = ACTIVATION.format(used=name, declared=network.activation)
            yield Variant(sentence, replace(network, activation=name).act)
    for factor in PERIODS:
        steps = problem.steps * factor
        if steps == int(steps) and problem.periods / factor >= 2:
            yield Variant(SLOWER if factor > 1 else FASTER, network.act, factor)
    yield from list_rare(parameters, problem, network)


def list_rare(parameters: PolicyParameters, problem: Problem, network: Network) -> Iterator[Variant]:
    """Yields the policy with outputs as shares from 0 to 1, with less where nothing is observed, and with the signs of
    two observations."""
    low, high = list_limits(problem.model)
    yield Variant(UNIT_SHARES, replace(network, limits=(2 * low - high, high)).act)
    names, controls = list_columns(parameters, problem), problem.model.nu
    width = network.layers[0][0].shape[0]
    with np.errstate(all="ignore"):
        rest = network.act(np.zeros(width)) * (1 - 1 / controls)
    if np.isfinite(rest).all() and rest.any():
        yield Variant(REST.format(number=controls), lambda seen: network.act(seen) - rest)
    for pair in combinations(range(width), 2) if width <= SIGNS_MAX else ():
        sign = np.where(np.isin(np.arange(width), pair), -1.0, 1.0)
        sentence = SIGNS_OF.format(names=" and ".join(names[i] for i in pair))
        yield Variant(sentence, lambda seen, sign=sign: network.act(seen * sign))  # type: ignore[misc]


def find_middle(network: Network) -> Floats:
    """Returns the controls about which the outputs are negated."""
    return np.zeros(1) if network.limits is None else np.asarray(sum(network.limits) / 2)


def list_transposed(network: Network) -> Iterator[Variant]:
    """Yields the policy with its square weights transposed, and with weights that a reshape has mixed up restored."""
    shapes = [weights.shape for weights, _ in network.layers]
    square = [i for i, shape in enumerate(shapes) if shape[0] == shape[1] > 1]
    mixed = [i for i, shape in enumerate(shapes) if min(shape) > 1]
    for template, places in ((TRANSPOSED, square), (RESHAPED, mixed)):
        for some in dict.fromkeys((tuple(places), *((place,) for place in places))):
            layers = [
                (weights.reshape(weights.shape[::-1]).T if i in some else weights, bias)
                for i, (weights, bias) in enumerate(network.layers)
            ]
            if some and (template is TRANSPOSED or not {*some} <= {*square}):
                names = " and ".join(f"W{i + 1}" for i in some)
                yield Variant(template.format(names=names), replace(network, layers=tuple(layers)).act)


def list_scaled(parameters: PolicyParameters, problem: Problem, network: Network) -> Iterator[Variant]:
    """Yields the policy with other outputs: as controls or as shares of the range, with or without a tanh."""
    limits, tanh = list_limits(problem.model), network.output == "tanh"
    scaled = network.limits is not None
    yield Variant(CONTROLS if scaled else SHARES, replace(network, limits=None if scaled else limits).act)
    other = replace(network, output="linear" if tanh else "tanh")
    yield Variant(UNSQUASHED if tanh else SQUASHED, other.act)
    yield Variant(CONTROLS if scaled else SHARES, replace(other, limits=None if scaled else limits).act)


def list_normalised(parameters: PolicyParameters, network: Network) -> Iterator[Variant]:
    """Yields the policy with another normalisation of what it observes."""
    if network.normalisation is not None:
        mean, std = network.normalisation
        yield Variant(VARIANCE, replace(network, normalisation=(mean, np.sqrt(std))).act)
        yield Variant(INVERSE, replace(network, normalisation=(mean, 1 / np.maximum(std, TINY))).act)
        yield Variant(TWICE, replace(network, normalisation=None).act)
    elif parameters.normalisation is not None:
        known = parameters.normalisation
        yield Variant(MISSING, replace(network, normalisation=(np.array(known.mean), np.array(known.std))).act)


def list_ordered(parameters: PolicyParameters, problem: Problem, network: Network) -> Iterator[Variant]:
    """Yields the policy with observations and controls in another order, and with the sign of one observation."""
    names, width = list_columns(parameters, problem), network.layers[0][0].shape[0]
    for order in list_orders(width, has_target=parameters.has_target):
        found, declared = (", ".join(names[i] for i in places) for places in (order, range(width)))
        sentence = ORDER.format(found=found, declared=declared)
        yield Variant(sentence, lambda seen, order=order: network.act(seen[list(order)]))  # type: ignore[misc]
    for place in range(width if width <= WIDTH_MAX else 0):
        sign = np.where(np.arange(width) == place, -1.0, 1.0)
        yield Variant(SIGN_OF.format(name=names[place]), lambda seen, sign=sign: network.act(seen * sign))  # type: ignore[misc]
    controls = problem.model.nu
    declared = ", ".join(problem.model.actuator(i).name or f"actuator {i}" for i in range(controls))
    for order in list_orders(controls, has_target=False):
        sentence = OUTPUTS.format(declared=declared)
        yield Variant(sentence, lambda seen, order=order: network.act(seen)[list(order)])  # type: ignore[misc]


def list_columns(parameters: PolicyParameters, problem: Problem) -> list[str]:
    """Returns the name of each number that is observed."""
    if problem.environment.observe is not None:
        return [f"observation[{i}]" for i in range(1000)]
    widths = list_widths(parameters, problem)
    return [f"{name}[{i}]" if width > 1 else name for name, width in widths.items() for i in range(width)]


def list_orders(width: int, *, has_target: bool) -> list[tuple[int, ...]]:
    """Returns orders of numbers that another program may use: halves exchanged (velocities before positions), each
    number beside its velocity, the other way round, the target first, and every exchange of two."""
    own, free = tuple(range(width)), width - has_target
    rest = own[free:]
    orders = []
    if free % 2 == 0 and free > 2:
        half = free // 2
        beside = tuple(np.arange(free).reshape(2, half).T.ravel().tolist())
        orders += [(*own[half:free], *own[:half], *rest), (*beside, *rest), (*np.argsort(beside).tolist(), *rest)]
    if has_target:
        orders.append((*rest, *own[:free]))
    for one, other in combinations(own, 2) if width <= WIDTH_MAX else ():
        changed = list(own)
        changed[one], changed[other] = other, one
        orders.append(tuple(changed))
    return [order for order in dict.fromkeys(orders) if order != own]


def list_in_degrees(parameters: PolicyParameters, problem: Problem, network: Network) -> Iterator[Variant]:
    """Yields the policy on degrees: in positions and velocities of hinges, where it is known which these are."""
    model = problem.model
    if problem.environment.observe is not None:
        factors = np.full(network.layers[0][0].shape[0], np.degrees(1.0))
    else:
        widths = list_widths(parameters, problem)
        angular = [is_angular(model, name, i) for name, width in widths.items() for i in range(width)]
        if parameters.has_target:
            angular[-1] = is_angular(model, parameters.track, 0)
        factors = np.where(angular, np.degrees(1.0), 1.0)
    if (factors != 1).any():
        yield Variant(DEGREES, lambda seen: network.act(seen * factors))


def is_angular(model: mujoco.MjModel, name: str, place: int) -> bool:
    """Whether an observed number is an angle, or the rate of one, of a hinge."""
    hinge, sensor = int(mujoco.mjtJoint.mjJNT_HINGE), mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, name)
    if sensor >= 0:
        kinds = (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL)
        return model.sensor_type[sensor] in map(int, kinds) and model.jnt_type[model.sensor_objid[sensor]] == hinge
    if name == "qpos":
        return place in model.jnt_qposadr[model.jnt_type == hinge]
    return name == "qvel" and bool(model.jnt_type[model.dof_jntid[place]] == hinge)
