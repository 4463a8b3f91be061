"""A server on a small content folder of its own, and clients with tokens."""

from support.api_clients import (  # noqa: F401  pytest finds fixtures in the names of this module
    ann,
    bob,
    content,
    either_shared_site,
    either_site,
    nobody,
    open_site_with,
    shared_site,
    site,
    teacher,
)
