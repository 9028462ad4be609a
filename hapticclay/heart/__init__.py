"""How one run advances: parts in, values out (docs/equations.md, section 4)."""
