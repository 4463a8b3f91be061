"""Auto-grading of a MuJoCo course: quizzes, simulations and scripts, judged by simulating again."""
