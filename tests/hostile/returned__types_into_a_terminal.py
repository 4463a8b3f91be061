"""TIOCSTI, TIOCLINUX."""

import fcntl

for request in (0x5412, 0x541C, 0x5401):
    for descriptor in (0, 1, 2):
        try:
            fcntl.ioctl(descriptor, request, b'x')
        except OSError as error:
            assert error.errno == 25
        else:
            raise AssertionError(request)
