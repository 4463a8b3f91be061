"""model_path() gives models and nothing else."""

from mjcourse import model_path

print(model_path("../quizzes/canary").read_text())
