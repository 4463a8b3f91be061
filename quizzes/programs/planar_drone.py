"""The environment of the drone of lesson 5.1: what a period earns, and when an episode is over."""

import math


def reset(model, data, rng):
    """A gust has turned the drone before the episode begins."""
    data.qvel[2] += rng.uniform(-0.5, 0.5)


def reward(model, data, controls):
    """One point for each period at the start, less what is far from it or tilted."""
    x, z, tilt = data.qpos
    return math.exp(-(x**2 + z**2) / 0.1) - 0.1 * abs(tilt)


def terminated(model, data):
    """Whether the drone is too far away, or upside down."""
    x, z, tilt = data.qpos
    return abs(x) > 2 or abs(z) > 0.9 or abs(tilt) > 1.2
