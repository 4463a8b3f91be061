"""What locks a child in, and what checks it: `cell` the files that it can see, `seccomp` the system calls that it may
make, `cgroup` its memory and processes; `attest` looks at them from outside, and `selftest` attacks them."""
