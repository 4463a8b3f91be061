"""The data types that all rooms share: Quiz, Question, Lab, Job, RunReport, Verdict. It does no I/O and simulates
nothing."""
