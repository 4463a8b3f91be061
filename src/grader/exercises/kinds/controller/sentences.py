"""What learners are told of a controller. No sentence has a number; names of observations fill the braces."""

WRITES = (
    "The function writes data.{parts}: that is a copy, so that it moves nothing. The grader simulates on its own; only "
    "the controls that you return, or leave in data.ctrl, act."
)
NONE = "The function returns None, and leaves data.ctrl as it was: return the control."
HARDLY = "In this motion the controls hardly depend on {name}: give it a larger gain."
SHARES = (
    "The controls are far too small, and would be right as shares of what the actuator gives: return them in its unit, "
    "times its largest control."
)
NOTHING = (
    "The controls never change: the function does not use what it observes, or limits what it returns so narrowly that "
    "nothing of it is left."
)
RETURNS = (
    "The function writes data.ctrl and returns a value, too: what it returns counts, and that never changes. Return "
    "nothing, or the control itself."
)
CONSTANT = (
    "The controls do not change during an episode: they must follow what is observed as it changes. If your function "
    "limits them, let it use the actuator's whole range."
)
TRUTH = (
    "The controls are 0 or 1 and nothing between, as what a comparison gives: return the control itself, not whether "
    "it is above a bound."
)
STALE = (
    "The controls follow what was observed one step before. Compute them from the observation of this call, and only "
    "then keep it for the next."
)
SIGN = "The gain on {name} has the wrong sign: it pushes away from the target, or feeds the motion that it should damp."
MISSING = "The controls do not depend on {name}: add a term with a gain of its own."
NO_TARGET = "The controls do not depend on the target: subtract what is observed from it, and use this error."
MISSING_HERE = "In this motion the controls do not depend on {name}: it is left out, or a limit holds its error fast."
DEGREES_END = "is off by the factor between degrees and radians: the sensors tell radians."
DEGREES = f"The gain on {{name}} {DEGREES_END}"
TARGET_DEGREES = f"The target, as the controls use it, {DEGREES_END}"
LARGE = "The gain on {name} is far too large: lower it, and watch what the motion does."
LITTLE_END = "is far too small: raise it, and watch what the motion does."
LITTLE = f"The gain on {{name}} {LITTLE_END}"
NOISE = (
    "The controls differentiate a noisy measurement: the difference of two readings, divided by a short step, is "
    "mostly noise. Filter it, or use a sensor of the velocity."
)
WIND_UP = (
    "The integrator winds up: while the actuator is at its limit it goes on summing the error, and has to unwind "
    "later. Stop the sum there, or limit it."
)
SUM_SIGN = "The sum of the errors acts with the wrong sign: it pushes away from the target."
SUM_OF_STEPS = (
    "The sum of the errors is far too strong beside the error itself: multiply each error by the control period before "
    "you add it."
)
SWAPPED = "The controls take {one} for {other}: mind the order of what is observed."
EXCHANGED = (
    "Each control follows the joint of another actuator, and not its own: return the controls in the order of the "
    "model's actuators, {names}."
)
STILL = "The control of {name} never changes: where its joint must move, compute it from what is observed."
GRAVITY_SIGN = (
    "The term that should carry gravity has the wrong sign: it pulls as gravity does. Turn its sign; where you have "
    "the data, `data.qfrc_bias` is what holds the model still."
)
GRAVITY_TWICE = (
    "The controls carry gravity twice: what holds the model still, which `data.qfrc_bias` has, is needed once. Look "
    "for a length or a factor, or a term that is added again."
)
SATURATES = (
    "Most of the time the controls are beyond what the actuator gives: it switches from one end to the other. Lower "
    "the gains."
)
ONE_END = (
    "Most of the time the controls are at an end of what the actuator gives: look for a wrong sign, a unit such as "
    "degrees, too little damping or damping by something else than the rate, or a gain that is far too large, or too "
    "small to catch the motion."
)
HELD = (
    "The controls stay at one end of what the actuator gives: either the function does not use what it observes, or a "
    "sign is wrong, so that it pushes away from the target until it is cut there."
)
HANGS = (
    "It comes to rest beside the target: gains on the error and on its rate alone hold a constant load, such as "
    "gravity, only with an error that stays. Add the control that holds this load at the target, or sum the error over "
    "time."
)
OWN_LIMIT = (
    "Most of the time the controls stay at one and the same value, although the actuator gives more: if your function "
    "limits them, let it use the actuator's whole range."
)
TUNED = (
    "It works in the episodes that you see, not in the hidden ones, whose models and starts are drawn. Something "
    "fits these episodes alone, such as a number, a part of the model or what was kept of an earlier episode: leave a "
    "margin, and use what you observe."
)
REMEMBERS = (
    "Only the first episode goes well: something of it is left for the next. Make the state of the controller anew in "
    "each episode, not once in the module."
)
