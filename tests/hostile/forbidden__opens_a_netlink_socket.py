"""socket(AF_NETLINK, SOCK_RAW)."""

import socket

socket.socket(socket.AF_NETLINK, socket.SOCK_RAW)
