"""Studies of physics. They measure error, stability and energy against run time, and what skipping parts of the engine
saves."""
