"""Auto-grading of a MuJoCo course: quizzes, simulations and scripts, judged by simulating again.

Every package is a room; docs/architecture.md is the map, and import-linter keeps imports pointing down.
"""

import os

os.environ.setdefault("MUJOCO_GL", "off")  # nothing here draws with OpenGL, whose import is a quarter of MuJoCo's
