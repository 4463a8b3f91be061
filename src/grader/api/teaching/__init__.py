"""Routes of instructors: reviews, regrades, the gradebook, statistics, extensions, people. Each route acts in the
course of the caller alone."""
