"""Studies of the service's own speed. They send answers and scripts to a real server, and compare it with a bare route
beside it."""
