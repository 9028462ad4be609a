"""Copies of records and of rows of numbers, which C makes by a copy of memory."""


def copied(to, of):
    """Copies a record into another of its kind."""
    to.copy(to, of)


def copied4(to, of):
    """Copies four numbers."""
    to[0], to[1], to[2], to[3] = of[0], of[1], of[2], of[3]


def copied_row(to, of, n):
    """Copies n numbers."""
    to[:n] = of[:n]


def cleared(x):
    """Puts a record back to its start."""
    x.copy(x, type(x)())
