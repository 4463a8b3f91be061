"""The wrong ways to a largest stable timestep, each with its sentence for the student; the first that fits is told."""

from math import pi

from grader.grading.threshold.methods import (
    WrongMethod,
    another_model,
    damped_joint,
    formula,
    gains_on_the_file,
    in_milliseconds,
    model_of_the_file,
    nothing_unstable,
    overshoots,
    pgs,
    simulated,
    swapped,
    too_wide,
    without_kv,
)
from grader.grading.threshold.parameters import INTEGRATORS

METHODS: tuple[WrongMethod, ...] = (
    WrongMethod(
        "milliseconds",
        "You reported milliseconds, not seconds: divide by 1000.",
        in_milliseconds,
    ),
    WrongMethod(
        "swapped",
        "The ends of your brackets are in the wrong order: return (h_stable, h_unstable), the smaller one first.",
        swapped,
    ),
    WrongMethod(
        "nothing unstable",
        "You found nothing unstable where there is a limit: step the model you were given, set the timestep on it, "
        "start with {start}, and look at data.warning (or at data.time running backwards), because after a warning "
        "MuJoCo has reset the state to a calm one.",
        nothing_unstable,
        all_claims=True,
        of_numbers=False,
    ),
    WrongMethod(
        "bound",
        "You reported the bound 2*sqrt(I/kp), which ignores the damper{shift}; simulate instead of computing it.",
        formula(lambda servo: servo.bound_s),
    ),
    WrongMethod(
        "damping bound",
        "You reported the damping bound 2*I/kv, which ignores the spring and holds for explicit damping only.",
        formula(lambda servo: 2 * servo.inertia / servo.kv if servo.kv else 0.0),
    ),
    WrongMethod(
        "smaller bound",
        "You reported the smaller of the bounds 2*sqrt(I/kp) and 2*I/kv; spring and damper act together, so simulate.",
        formula(lambda servo: min(servo.bound_s, 2 * servo.inertia / servo.kv if servo.kv else servo.bound_s)),
    ),
    WrongMethod(
        "half the bound",
        "You reported sqrt(I/kp) = 1/omega; the explicit spring limit is twice that, and the damper moves it again.",
        formula(lambda servo: servo.bound_s / 2),
    ),
    WrongMethod(
        "period",
        "You reported the period 2*pi*sqrt(I/kp) of the oscillation, not a stability limit.",
        formula(lambda servo: pi * servo.bound_s),
    ),
    WrongMethod(
        "too wide",
        "Your brackets hold the limit but are too wide: go on halving until they are no wider than {width} ms.",
        too_wide,
    ),
    WrongMethod(
        "model of the file",
        "You measured the model as it stands in its file, with its own gains: measure the model you were given.",
        model_of_the_file,
    ),
    WrongMethod(
        "mass of the file",
        "You took the gains of the model you were given, but mass and length from the file: measure the model you were "
        "given.",
        gains_on_the_file,
        all_claims=True,
    ),
    WrongMethod(
        "another model",
        "You reported the limits of the first model for every model: measure the model you were given.",
        another_model,
    ),
    WrongMethod(
        "Euler everywhere",
        "Every integrator got Euler's limit: either model.opt.integrator is not set, or the servo's torque is computed "
        "in Python (as for a motor), which is explicit whatever the integrator.",
        simulated(code=INTEGRATORS["Euler"]),
        all_claims=True,
    ),
    WrongMethod(
        "PGS",
        "You set the solver to PGS, under which MuJoCo's discrete integrator silently becomes explicit.",
        pgs,
    ),
    WrongMethod(
        "kv forgotten",
        "Your limits are those of a servo without its damping kv: keep the actuator's third bias parameter, -kv.",
        simulated(without_kv),
    ),
    WrongMethod(
        "damped joint",
        "Your limits are those of a pendulum with the joint's damping in place of the servo's kv: Euler treats a "
        "joint's damping implicitly, an actuator's explicitly.",
        simulated(damped_joint),
    ),
    WrongMethod(
        "RK4",
        "Every integrator got RK4's limit: set model.opt.integrator to the integrator you are given.",
        simulated(code=INTEGRATORS["RK4"]),
        all_claims=True,
    ),
    WrongMethod(
        "implicitfast everywhere",
        "Every integrator got implicitfast's limit: set model.opt.integrator to the integrator you are given.",
        simulated(code=INTEGRATORS["implicitfast"]),
        all_claims=True,
    ),
    WrongMethod(
        "half a second",
        "Your runs are too short: within half a second a slow divergence does not show yet. Run for {horizon} s.",
        simulated(seconds=0.5),
    ),
    WrongMethod(
        "one second",
        "Your runs are too short: within one second a slow divergence does not show yet. Run for {horizon} s.",
        simulated(seconds=1.0),
    ),
    WrongMethod(
        "overshoot",
        "You called an overshoot unstable: the motion first swings out further than it started, but then decays.",
        overshoots,
    ),
)
