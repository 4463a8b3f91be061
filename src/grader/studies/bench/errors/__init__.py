"""Studies of errors alone. They measure no time, so their results are the same on a busy machine."""
