"""Path traversal out of the scratch directory."""

import target

print(open("../../../../.." + target.CONTENT + "/quizzes/canary.json").read())
