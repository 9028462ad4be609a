"""Formulas of floats: what CPython runs and Cython compiles. Each stands once."""
