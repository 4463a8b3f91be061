"""The jail: runs one student's script in a process that can read none of our files and reach no other process.

`jail.py` is the interface (`Jail.run(job) -> RunReport`). Behind it:

    policy    what is allowed, as data              seccomp   the policy as a kernel filter
    cell      the bubblewrap cell and its binds     zygote    the warm process in the cell, and its children
    pool      children that wait, locked down       attest    a child's locks, checked from outside
    watch     one run: pipes, limits, the kill      usage     CPU time, waiting time and memory of a child
    frames    what the script sends back, parsed    cleaning  what it printed, made safe to show
    report    how it ended, in one sentence         cgroup    memory and process counts, where delegated
    selftest  attacks that must fail at start       inside/   runs in the cell; imports nothing of ours
"""
