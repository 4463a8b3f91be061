"""The data types that all rooms share, such as Lab, Job, RunReport and Verdict, without I/O."""
