"""The first-order mutants of the right step, each with the sentence for the student."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from grader.exercises.kinds.rk4.mutants.physics import ACCELERATIONS, ROTATIONS
from grader.exercises.kinds.rk4.mutants.program import THIRDS, StepProgram

RIGHT = StepProgram()

HALVES = ("t", "t + h/2", "t + h/2", "t + h")
FRACTIONS = ("nothing", "h/2", "h/2", "h")

FIRST_MISSING = (
    "Your first acceleration is data.qacc as it stood before the step: nothing has computed it for this state. Call "
    "mj_forward before you read data.qacc."
)


@dataclass(frozen=True)
class Mutant:
    """A change of the right step. `place` says where: "stage 2" to "stage 4" or "end", and the part of the state, with
    "forward" for the call itself. `is_tableau`: another Butcher tableau, which the tableau's own sentences name."""

    sentence: str
    changes: Mapping[str, Any]
    place: tuple[str, str]
    is_tableau: bool = False

    @property
    def program(self) -> StepProgram:
        """The program of this mutant alone."""
        return replace(RIGHT, **self.changes)


def combine(one: Mutant, other: Mutant) -> StepProgram | None:
    """Returns the program of two mutants; None where they change the same entry, or nothing more than one of them."""
    changes: dict[str, Any] = dict(one.changes)
    if "rate" in {*one.changes, *other.changes} and "velocities" in {*one.changes, *other.changes}:
        return None  # the change of a quaternion is no velocity
    for name, value in other.changes.items():
        before, right = changes.get(name), getattr(RIGHT, name)
        if before is None:
            changes[name] = value
            continue
        if not isinstance(right, tuple) or len(right) != len(value):
            return None
        merged = []
        for mine, theirs, plain in zip(before, value, right, strict=True):
            if plain not in (mine, theirs):  # both change it
                return None
            merged.append(theirs if mine == plain else mine)
        changes[name] = tuple(merged)
    return replace(RIGHT, **changes)


def put(values: Sequence[Any], place: int, value: Any) -> tuple[Any, ...]:
    """Returns a tuple with another value in one place."""
    return (*values[:place], value, *values[place + 1 :])


def list_call_mutants() -> Iterator[Mutant]:
    """Yields the steps in which mj_forward is called too seldom, or the state is not there when it is."""
    for stage in range(4):
        calls = put(RIGHT.calls, stage, False)
        sentence = (
            f"In your stage {stage + 1} mj_forward is not called: data.qacc is still that of stage {stage}. Call "
            f"mujoco.mj_forward after the state of stage {stage + 1} is written, and before data.qacc is read."
        )
        yield Mutant(sentence if stage else FIRST_MISSING, {"calls": calls}, (f"stage {stage + 1}", "forward"))
    yield Mutant(
        "mj_forward is called once in your step, at its start: every stage reads the same data.qacc. Call "
        "mujoco.mj_forward at every stage, after its state is written and before data.qacc is read.",
        {"calls": (True, False, False, False)},
        ("stage 2", "forward"),
    )
    for stage in (1, 2, 3):
        for part, what in (("q", "positions"), ("v", "velocities")):
            name = {"q": "data.qpos", "v": "data.qvel"}[part]
            yield Mutant(
                f"The {what} of your stage {stage + 1} are not written: when mj_forward is called, {name} still holds "
                f"those of stage {stage}. Write {name}[:] before the call.",
                {f"written_{part}": put(RIGHT.written_q, stage, False)},
                (f"stage {stage + 1}", name.removeprefix("data.")),
            )


def list_stage_mutants() -> Iterator[Mutant]:
    """Yields the steps in which one stage is reached in another way."""
    for stage in (1, 2, 3):
        name, right = f"stage {stage + 1}", THIRDS[stage]
        for share, text in ((0.0, "nothing"), (0.25, "h/4"), (0.5, "h/2"), (1.0, "h"), (2.0, "2 h"), (-right, "-h")):
            if share == right:
                continue
            how = f"by -{FRACTIONS[stage]}, backwards" if share < 0 else f"by {text}"
            for parts, what, field in (("qva", "moves", "qpos"), ("q", "moves positions", "qpos"),
                                       ("v", "moves velocities", "qvel"), ("a", "moves data.act", "act")):  # fmt: skip
                yield Mutant(
                    f"Your {name} {what} {how}: it should be {FRACTIONS[stage]}, from the start of the step.",
                    {f"reach_{part}": put(THIRDS, stage, share) for part in parts},
                    (name, field), is_tableau=True
                )  # fmt: skip
        for slope in range(4):
            if slope < stage and slope != stage - 1:
                yield Mutant(
                    f"Your {name} uses slope k{slope + 1}: it is reached with k{stage}, that of the stage before.",
                    {"slopes": put(RIGHT.slopes, stage, slope)}, (name, "qpos"), is_tableau=True
                )  # fmt: skip
        for parts, what in (("qv", "state"), ("q", "position"), ("v", "velocity")):
            yield Mutant(
                f"The {what} of your {name} starts from that of stage {stage}, not from the start of the step: keep "
                "copies of the start, and add to them.",
                {f"origins_{part}": put(RIGHT.origins_q, stage, "here") for part in parts},
                (name, "qvel" if parts == "v" else "qpos"),
            )
        yield Mutant(
            f"The position of your {name} moves with the velocity at the start of the step: move it with that of stage "
            f"{stage}.",
            {"velocities": put(RIGHT.velocities, stage, "start")}, (name, "qpos"), is_tableau=stage == 1
        )  # fmt: skip
        yield Mutant(
            f"The position of your {name} moves with the stage's own new velocity: move it with the velocity of stage "
            f"{stage}.",
            {"velocities": put(RIGHT.velocities, stage, "own")}, (name, "qpos")
        )  # fmt: skip


def list_time_mutants() -> Iterator[Mutant]:
    """Yields the steps in which data.time is another one."""
    for stage in range(4):
        for time, text in ((0.0, "t"), (0.5, "t + h/2"), (1.0, "t + h")):
            if time != THIRDS[stage]:
                yield Mutant(
                    f"data.time is {text} in your stage {stage + 1}: it should be {HALVES[stage]} when mj_forward is "
                    "called.",
                    {"times": put(RIGHT.times, stage, time)}, (f"stage {stage + 1}", "time")
                )  # fmt: skip
    still = {"times": (0.0, 0.0, 0.0, 0.0, 1.0)}
    yield Mutant(
        "data.time stands still in all your stages: set it to t, t + h/2, t + h/2 and t + h before the four calls of "
        "mj_forward.",
        still, ("stage 2", "time")
    )  # fmt: skip
    yield Mutant(
        "data.time does not change in your step: set it in every stage, and to t + h at the end.",
        {"times": (0.0,) * 5}, ("end", "time")
    )  # fmt: skip
    yield Mutant(
        "data.time is not advanced at the end of your step: set it to t + h.",
        {"times": (*THIRDS, 0.0)},
        ("end", "time"),
    )
    yield Mutant(
        "data.time advances by 2 h in your step: it is t + h in the last stage already, so do not add h to it.",
        {"times": (*THIRDS, 2.0)}, ("end", "time")
    )  # fmt: skip
    yield Mutant(
        "data.time adds up over your stages, by 3 h in a step: keep t, and set data.time to t + h/2, t + h/2, t + h.",
        {"times": (0.0, 0.5, 1.0, 2.0, 3.0)}, ("stage 3", "time")
    )  # fmt: skip


WRONG_SUMS: Sequence[tuple[Sequence[float], float]] = (
    *(((1, 1, 1, 1), 4), ((1, 1, 1, 1), 6), ((2, 1, 1, 2), 6), ((1, 3, 3, 1), 8), ((1, 2, 2, 1), 4)),
    *(((1, 2, 2, 1), 3), ((1, 2, 2, 1), 5), ((1, 2, 2, 1), 8), ((1, 2, 2, 1), 1), ((1, 2, 1, 1), 6)),
    *(((1, 1, 2, 1), 6), ((1, 2, 1, 2), 6), ((2, 2, 1, 1), 6), ((1, 2, 2, 2), 6), ((2, 2, 2, 1), 6)),
    *(((1, 2, 2, 0), 6), ((0, 2, 2, 1), 6), ((1, 2, 2, -1), 6), ((1, -2, 2, 1), 6), ((1, 2, -2, 1), 6)),
    *(((1, 4, 0, 1), 6), ((1, 0, 4, 1), 6), ((0, 0, 1, 0), 1), ((0, 1, 0, 0), 1), ((1, 0, 0, 0), 1), ((0, 0, 0, 1), 1)),
    *(((1, 0, 0, 1), 2), ((0, 1, 1, 0), 2), ((0, 2, 2, 2), 6), ((1, 0, 2, 3), 6), ((1, 2, 0, 3), 6)),
)
"""Weights, and what they are divided by. The last three are those of a slope that is a view, not a copy."""

PARTS = {"q": "velocities", "v": "accelerations", "a": "act_dot"}


def list_end_mutants() -> Iterator[Mutant]:
    """Yields the steps that end in another way."""
    for weights, divisor in WRONG_SUMS:
        row = tuple(weight / divisor for weight in weights)
        fraction = f"{', '.join(map(str, weights))} over {divisor:g}"
        for parts in ("qva", *PARTS):
            what = "slopes" if len(parts) > 1 else PARTS[parts]
            yield Mutant(
                f"The weights of your {what} are {fraction}: they should be 1, 2, 2, 1 over 6.",
                {f"weights_{part}": row for part in parts},
                ("end", {"q": "qpos", "v": "qvel", "a": "act"}[parts[0]]), is_tableau=True
            )  # fmt: skip
    for parts, what in (("qv", "state"), ("q", "position"), ("v", "velocity")):
        yield Mutant(
            f"The weighted sum is added to the {what} of your last stage: add it to that at the start of the step.",
            {f"origins_{part}": put(RIGHT.origins_q, 4, "here") for part in parts},
            ("end", "qvel" if parts == "v" else "qpos"),
        )
    yield Mutant(
        "The position advances with the new velocity alone; use the weighted mean of the four stage velocities.",
        {"velocities": put(RIGHT.velocities, 4, "new")}, ("end", "qpos")
    )  # fmt: skip
    yield Mutant(
        "At the end of your step positions are clipped to the joints' ranges: MuJoCo does not clip them. A joint limit "
        "is a force in data.qacc, so leave data.qpos as the formula gives it.",
        {"clips": True}, ("end", "qpos")
    )  # fmt: skip


ALIASED = "without .copy(), q = data.qpos is data.qpos itself"


def list_whole_mutants() -> Iterator[Mutant]:
    """Yields the steps with one change in several places."""
    here = ("start", "here", "here", "here")
    for ends, also in (("start", ""), ("here", " The weighted sum, too, is added to the last stage.")):
        for parts, what in (("qv", "state"), ("q", "position"), ("v", "velocity")):
            yield Mutant(
                f"Each of your stages moves the {what} on from the stage before, not from the start of the step.{also} "
                f"Keep a copy of the start ({ALIASED}), and add to that.",
                {f"origins_{part}": (*here, ends) for part in parts},
                ("stage 3", "qvel" if parts == "v" else "qpos"), is_tableau=True
            )  # fmt: skip
    for which, what in (("start", "the velocity at the start of the step"), ("own", "their own new velocity")):
        yield Mutant(
            f"Your stages move the position with {what}: move it with the velocity of the stage before.",
            {"velocities": ("slope", which, which, which, "slope")}, ("stage 3", "qpos"), is_tableau=True
        )  # fmt: skip
    yield Mutant(
        "data.time is t + h in your middle stages: it should be t + h/2 there.",
        {"times": (0.0, 1.0, 1.0, 1.0, 1.0)}, ("stage 2", "time")
    )  # fmt: skip
    halved = {f"reach_{part}": (0.0, 0.5, 0.5, 0.5) for part in "qva"}
    sums = {f"weights_{part}": (1 / 12, 1 / 6, 1 / 6, 1 / 12) for part in "qva"}
    for times in ((*THIRDS, 1.0), (0.0, 0.5, 0.5, 0.5, 0.5), (0.0, 0.5, 0.5, 0.5, 1.0)):
        yield Mutant(
            "h is halved before the middle stages and stays so: the last stage and the weighted sum need the whole "
            "h = model.opt.timestep.",
            {**halved, **sums, "times": times}, ("stage 4", "qpos")
        )  # fmt: skip
    never = {"reach_a": (0.0,) * 4, "weights_a": (0.0,) * 4}
    yield Mutant(
        "data.act does not change: advance it with data.act_dot, as you advance qvel with qacc.", never, ("end", "act")
    )
    still = "data.act stands still in your stages, and ends with"
    cure = (
        "it is a state like qvel, so move it in every stage, and by the weighted mean of the four act_dot at the end."
    )
    for weights, what in (((1.0, 0.0, 0.0, 0.0), "the first act_dot alone"), ((0.0, 0.0, 0.0, 1.0), "the last alone"),
                          (RIGHT.weights_a, "their weighted mean")):  # fmt: skip
        yield Mutant(f"{still} {what}: {cure}", {"reach_a": (0.0,) * 4, "weights_a": weights}, ("end", "act"))
    for names, what in (
        (("ctrl", "act", "time"), "neither controls, activations nor time"),
        (("ctrl", "act"), "neither controls nor activations"), (("ctrl", "time"), "neither controls nor time"),
        (("act", "time"), "neither activations nor time"), (("ctrl",), "no controls"),
    ):  # fmt: skip
        if len(names) > 1:
            yield Mutant(
                f"Your stages are evaluated in a data that has {what}: they are 0 in every call of mj_forward. Copy "
                "them from the data that you are given, or use mj_copyData.",
                {"bare_data": names, "reach_a": (0.0,) * 4, "weights_a": (0.0,) * 4},
                ("stage 2", "forward"),
            )
        yield Mutant(
            f"Your stages are evaluated with {what}: they are 0 in every call of mj_forward, as after mj_resetData or "
            "in a new MjData. Copy them from the data that you are given.",
            {"bare_data": names},
            ("stage 2", "forward"),
        )


def list_physics_mutants() -> Iterator[Mutant]:
    """Yields the steps with other accelerations, or that turn quaternions in another way."""
    for sentence, accelerate in ACCELERATIONS:
        yield Mutant(sentence, {"accelerate": accelerate}, ("stage 2", "qvel"))
    for sentence, changes in ROTATIONS:
        yield Mutant(sentence, changes, ("stage 2", "qpos"))


def list_mutants() -> tuple[Mutant, ...]:
    """Returns all mutants; of those with the same program the first."""
    makers = (
        list_call_mutants, list_whole_mutants, list_time_mutants, list_physics_mutants, list_stage_mutants,
        list_end_mutants,
    )  # fmt: skip
    mutants: dict[StepProgram, Mutant] = {}
    for make in makers:
        for mutant in make():
            mutants.setdefault(mutant.program, mutant)
    mutants.pop(RIGHT, None)
    return tuple(mutants.values())


MUTANTS = list_mutants()

OF_BARE_DATA = tuple(mutant for mutant in MUTANTS if len(mutant.changes.get("bare_data", ())) > 1)
"""Those that lack several parts of data, so that each sentence on one of them tells too little."""

assert {name for mutant in MUTANTS for name in mutant.changes} <= {part.name for part in fields(StepProgram)}
