"""Auto-grading of a MuJoCo course: quizzes, simulations and scripts, judged by simulating again.

Every package is a room; docs/architecture.md is the map, and import-linter keeps imports pointing down.
"""
