"""MuJoCo measurements: scenes, rollouts, thresholds, references. Pure: no I/O beyond MJCF text."""
