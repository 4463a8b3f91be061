"""The JSON API under /api/v1, with health and the OpenAPI document. Routes have no logic of their own: they read the
request, call a room below, and return a value."""
