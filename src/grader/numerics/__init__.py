"""Measures MuJoCo models: scenes, rollouts, stability and accuracy. Every other room that simulates does so through
this one. It performs no I/O."""
