"""What is said of a wrong step: first what was seen, then what to do."""
