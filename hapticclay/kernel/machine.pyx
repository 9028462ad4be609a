"""The way into the compiled kernel: it advances rows of models and states, without Python's lock."""

from . cimport arm, begin, energy, path, watch
from .records cimport Engine_s, Model_s, State_s

SIZES = sizeof(Model_s), sizeof(State_s), sizeof(Engine_s)


def begin_run(size_t model, size_t state, double px, double py, double vx, double vy):
    """Puts a state to the start of a run, the handle at p with velocity v."""
    begin.begin(<Model_s *>model, <State_s *>state, px, py, vx, vy)


def advance(size_t models, size_t states, size_t which, Py_ssize_t n, long room):
    """Makes steps of rows until so many rows of theirs are filled.

    Args:
        models: address of an array of models.
        states: address of an array of states.
        which: address of the indices of the rows.
        n: how many there are.
        room: rows to fill.
    """
    cdef Model_s *m = <Model_s *>models
    cdef State_s *s = <State_s *>states
    cdef const long long *w = <const long long *>which
    cdef Py_ssize_t j
    with nogil:
        for j in range(n):
            arm.put(&m[w[j]], &s[w[j]])
            path.advance(&m[w[j]], &s[w[j]], room)
