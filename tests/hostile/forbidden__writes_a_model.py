"""Changes the lesson for the next student."""

from mjcourse import model_path

model_path("pendulum").write_text("<mujoco/>")
