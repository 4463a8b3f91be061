"""Episodes of a model under feedback: how authors write them, the simulation, the goals, the verdict on the share that
succeeds, and the pictures. The kinds `controller` and `policy` differ in who computes the controls."""
