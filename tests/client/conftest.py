"""A server on a small content folder, for the client's tests."""

from support.api_clients import shared_site, site  # noqa: F401  pytest finds fixtures in the names of this module
