"""The rules of a course as pure functions: policy, rubric, statistics, the gradebook. They read no database and no
clock: callers pass in everything."""
