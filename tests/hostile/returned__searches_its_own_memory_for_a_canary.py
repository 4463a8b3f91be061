"""The zygote never held a secret, so no child inherits one."""

import gc
import sys

found = []
for thing in gc.get_objects():
    try:
        text = repr(thing)
    except Exception:
        continue
    found += [text[:200]] if "/quizzes" in text or "grader.db" in text else []
for frame in (sys._getframe(n) for n in range(3)):
    found += [name for name in frame.f_globals if "secret" in name.lower()]
# The driver's inputs, which the attack was told of, are the only place.
print(len(found))
