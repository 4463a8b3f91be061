"""DNS as a way out."""

import socket

socket.getaddrinfo("example.org", 80)
