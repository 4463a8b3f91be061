"""Pages on which instructors review answers: the list, an answer, the lines of a script, and its attempts."""
