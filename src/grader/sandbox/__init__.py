"""The jail: runs one student's script in a process that can read none of our files and reach no other process.

`jail.py` is the interface (`Jail.run(job) -> RunReport`). Behind it:

    policy    what is allowed, as data              zygote    the warm process in the cell, and its children
    pool      children that wait, locked down       watch     one run: pipes, limits, the kill
    usage     CPU time and memory of a child        frames    what the script sends back, parsed
    report    how it ended, in one sentence         cleaning  what it printed, made safe to show
    spent     where a slow script was               talking   a judge that asks a script step by step
    locks/    what locks a child in, and checks it  inside/   runs in the cell; imports nothing of ours
"""
