"""What the jail allows, as data. Limits are measured on MuJoCo 3.14.0: tighter AS or DATA hangs its threads."""

from typing import Final


def _split(text: str) -> tuple[str, ...]:
    return tuple(text.split())


KB: Final = 1024
MB: Final = 1024 * KB

# Oldest Landlock ABI for a tier. Where namespaces hide the file system, Landlock is the second wall and ABI 1 will do;
# where it is the only wall it must also scope signals and sockets (ABI 6).
LANDLOCK_ABI_MIN: Final = 1
LANDLOCK_ABI_MIN_ALONE: Final = 6

NOBODY: Final = 65534
SCRATCH: Final = "/scratch"
SCRATCH_BYTES: Final = 16 * MB
SCRATCH_INODES: Final = 256
MODELS: Final = "/models"

# MuJoCo's thread pool hangs when a thread cannot be started: leave room for 32 workers, as many as its own tests start,
# and keep their stacks small, as RLIMIT_DATA counts them whole.
THREADS_MAX: Final = 64
THREAD_STACK_BYTES: Final = 2 * MB
RESULT_BYTES_MAX: Final = 16 * MB
RESULT_ARRAYS_MAX: Final = 512
NAME_CHARS_MAX: Final = 32
NDIM_MAX: Final = 4

# Set by the child itself; memory and CPU time are lowered to the job's own limits from outside.
RLIMITS: Final = {
    "RLIMIT_CORE": 0,
    "RLIMIT_NOFILE": 64,
    "RLIMIT_FSIZE": SCRATCH_BYTES,
    "RLIMIT_MEMLOCK": 0,
    "RLIMIT_MSGQUEUE": 0,
    "RLIMIT_SIGPENDING": 64,
    "RLIMIT_NPROC": THREADS_MAX,
    "RLIMIT_STACK": 8 * MB,
}
# Address space beyond RLIMIT_DATA: libraries and other read-only mappings, which DATA does not count.
ADDRESS_SPACE_EXTRA: Final = 512 * MB
# What a cgroup counts beyond RLIMIT_DATA: page tables, the scratch directory, pipes.
CGROUP_MEMORY_EXTRA: Final = 64 * MB
# RLIMIT_CPU only backs up the supervisor's exact clock. It counts scheduler ticks, which on a busy machine run up to
# 20 % fast, so it is set well above the job's limit: this factor times the limit, plus these seconds.
CPU_BACKSTOP_FACTOR: Final = 2
CPU_BACKSTOP_S: Final = 5
# Private memory beyond RLIMIT_DATA at which the supervisor ends a process: it leaves room for the main thread's stack
# and for relocated libraries, which DATA does not count either.
RESIDENT_EXTRA: Final = 32 * MB

ENVIRONMENT: Final = {
    "PATH": "/usr/bin:/bin",
    "HOME": SCRATCH,
    "TMPDIR": SCRATCH,
    "LANG": "C.UTF-8",
    "PYTHONHASHSEED": "0",
    "MUJOCO_GL": "disable",
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MALLOC_ARENA_MAX": "2",
    # A fixed threshold keeps glibc from raising its own: one MjData a step (13 MB each) would fragment the heap.
    "MALLOC_MMAP_THRESHOLD_": str(1 * MB),
}

PACKAGES: Final = _split("mujoco numpy scipy absl etils fsspec glfw OpenGL typing_extensions.py websockets zipp")
"""What scripts may import beside the standard library: MuJoCo, NumPy, SciPy, and what these import. All else that is
installed is in no cell, such as this package, a plug-in or the tools of a developer: no script needs a certain server.
"""

# Imported once, by the zygote: the packages, and what students usually import beside them.
PRELOAD: Final = _split("""
mujoco mujoco.rollout mujoco.viewer numpy.random numpy.fft numpy.polynomial numpy.ma numpy.linalg
json math cmath time datetime dataclasses collections functools itertools operator threading typing pathlib tempfile
concurrent.futures concurrent.futures.thread queue random statistics fractions decimal enum abc copy io re string
textwrap difflib contextlib warnings traceback logging argparse inspect pprint bisect heapq struct timeit csv
encodings.idna encodings.ascii encodings.latin_1
""")

# -- seccomp: a call that is not named fails with ENOSYS, so that the C library falls back -----------------------------
# seccomp.py adds the calls whose arguments decide: mmap, mprotect, clone, fcntl, prctl, prlimit64, tgkill.

ALLOWED: Final = _split("""
read readv pread64 preadv write writev pwrite64 pwritev lseek close fstat newfstatat stat lstat statx
access faccessat faccessat2 openat open creat readlink readlinkat getcwd chdir getdents64 getdents mkdir mkdirat rmdir
unlink unlinkat rename renameat renameat2 ftruncate truncate fsync fdatasync dup dup2 dup3 pipe pipe2 umask fstatfs
statfs close_range munmap mremap brk madvise futex set_robust_list get_robust_list rseq set_tid_address
exit exit_group gettid getpid getppid membarrier getuid geteuid getgid getegid getgroups getresuid getresgid getpgrp
getpgid getsid rt_sigaction rt_sigprocmask rt_sigreturn rt_sigpending rt_sigtimedwait sigaltstack restart_syscall pause
clock_gettime clock_getres clock_nanosleep nanosleep gettimeofday time times getrusage getitimer setitimer alarm
getrandom sched_yield sched_getaffinity sched_getscheduler sched_getparam sched_get_priority_min sched_get_priority_max
getcpu getpriority sysinfo uname getrlimit poll ppoll select pselect6
""")

# F_DUPFD F_GETFD F_SETFD F_GETFL F_SETFL F_DUPFD_CLOEXEC; not locks, leases, owners, pipe sizes or notifications.
FCNTL_COMMANDS: Final = (0, 1, 2, 3, 4, 1030)
PR_SET_NAME: Final = 15

# Calls that ordinary programs may try: they fail with EPERM, and Python raises PermissionError.
REFUSED: Final = _split("""
fork vfork execve execveat socket socketpair connect bind listen accept accept4 sendto sendmsg
sendmmsg recvfrom recvmsg recvmmsg getsockname getpeername setsockopt getsockopt shutdown kill tkill rt_sigqueueinfo
rt_tgsigqueueinfo pidfd_open pidfd_send_signal setsid setpgid link linkat symlink symlinkat mknod mknodat chmod fchmod
fchmodat fchmodat2 chown fchown lchown fchownat setxattr lsetxattr fsetxattr removexattr lremovexattr fremovexattr
utime utimes utimensat futimesat mlock mlock2 mlockall munlock munlockall memfd_create shmget shmat shmctl shmdt semget
semop semctl semtimedop msgget msgsnd msgrcv msgctl mq_open mq_unlink mq_timedsend mq_timedreceive mq_notify
sched_setaffinity sched_setscheduler sched_setparam sched_setattr setpriority ioprio_set setrlimit setuid setgid
setreuid setregid setresuid setresgid setgroups setfsuid setfsgid capset capget fallocate flock sendfile splice tee
vmsplice copy_file_range inotify_init inotify_init1 inotify_add_watch fanotify_init timer_create timerfd_create
signalfd signalfd4 eventfd eventfd2 epoll_create epoll_create1 personality
""")

# Calls that no honest script makes: the process ends with SIGSYS.
KILLED: Final = _split("""
ptrace process_vm_readv process_vm_writev process_madvise process_mrelease kcmp pidfd_getfd bpf
io_uring_setup io_uring_enter io_uring_register userfaultfd perf_event_open add_key request_key keyctl init_module
finit_module delete_module create_module kexec_load kexec_file_load mount umount2 pivot_root chroot unshare setns fsopen
fsconfig fsmount fspick move_mount open_tree mount_setattr open_by_handle_at name_to_handle_at iopl ioperm modify_ldt
reboot swapon swapoff acct quotactl quotactl_fd settimeofday clock_settime adjtimex clock_adjtime sethostname
setdomainname syslog vhangup lookup_dcookie migrate_pages move_pages uselib ustat sysfs _sysctl
nfsservctl seccomp memfd_secret landlock_create_ruleset landlock_add_rule landlock_restrict_self
""")
