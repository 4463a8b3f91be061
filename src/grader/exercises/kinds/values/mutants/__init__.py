"""Programs with one edit: those of the author's program show which mistake gives a student's results, those of the
student's own program in which line it is."""
