"""Why a request to another server got no usable answer. Apart from the client for HTTP, which may not be installed."""


class Unreachable(Exception):
    """No usable answer came: no connection, too late, or too large. Another try may help."""


class TooSlow(Unreachable):
    """No answer came in time: the request has held up what waits behind it."""


class Oversized(Unreachable):
    """The answer is larger than any that is expected."""
