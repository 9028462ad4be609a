"""Bounds that formulas share."""

B_MAX = 1e9  # [N.s/m] largest damping of the clay; the engine refuses controls above 1e10
