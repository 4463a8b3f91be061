"""Measures MuJoCo models: scenes, rollouts, thresholds, reference solutions. Does no I/O."""
