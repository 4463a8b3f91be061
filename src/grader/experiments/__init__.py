"""Experiments: what is measured in runs of a model, and how far that depends on the timestep and on the start. Answer
keys (`certify`) and the claims of a learner's script (`exercises/kinds/claims`) are measured here alike."""
