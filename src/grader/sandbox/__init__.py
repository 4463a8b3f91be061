"""The jail: one student's script, run by a process that can read nothing of ours and reach nobody.

`jail.py` is the door (`Jail.run(job) -> RunReport`). Behind it, one file per job:

    policy    what is allowed, as data             seccomp   the policy as a kernel filter
    cell      the bubblewrap cell and its binds    zygote    the warm process in the cell that forks children
    spares    children that wait, locked down      attest    a child's locks, checked from outside
    watch     one run: pipes, clocks, the kill     frames    what the script sends back, parsed strictly
    report    how it ended, in one sentence        cleaning  what it printed, made safe to show
    selftest  attacks that must fail at start      cgroup    memory and process counts, where delegated
    inside/   runs in the cell; imports nothing of ours
"""
