"""HTTP JSON under /api/v1, with health, and the checks that every request passes."""
