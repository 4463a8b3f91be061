"""HTTP JSON under /api/v1, and what stands beside it: health, sign-in."""
