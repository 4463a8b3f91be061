"""Even to itself."""

import socket

socket.socketpair()
