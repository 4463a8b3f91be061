"""What runs in the jail beside a script: the harness, the recorder, a kind's driver, and the channel to it."""
