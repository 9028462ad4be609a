"""The way into the compiled kernel: rows of models and states, without Python's lock.

Records are given by the address of an array of them; `which` is that of the indices of n rows.
"""

from . cimport loop
from .records cimport Engine_s, Model_s, State_s, Summary_s

SIZES = {
    "Model": sizeof(Model_s), "State": sizeof(State_s), "Engine": sizeof(Engine_s),
    "Summary": sizeof(Summary_s),
}


def compute_probe(size_t links, size_t out):
    """Computes the numbers that are compared with CPython's before this is used."""
    loop.kernel_probe_fill(<double *>links, <double *>out)


def begin_run(size_t model, size_t state, double px, double py, double vx, double vy):
    """Puts a state to the start of a run, the handle at p with velocity v."""
    loop.kernel_begin_begin(<Model_s *>model, <State_s *>state, px, py, vx, vy)


def change(size_t model, size_t state):
    """Continues a run in a changed scene with the same borders."""
    loop.kernel_begin_change(<Model_s *>model, <State_s *>state)


def look(size_t model, size_t state, long first, long n):
    """Whether the monitor can have nothing to report on rows, nor had it before."""
    loop.kernel_watch_look(<Model_s *>model, <State_s *>state, first, n)
    return bool((<State_s *>state).watch.quiet)


def advance(size_t models, size_t states, size_t which, Py_ssize_t n, size_t rooms, bint tests):
    """Makes steps of rows until as many rows of theirs are filled as `rooms` says, by row.

    tests: the quick test of the monitor looks at the rows made.
    """
    cdef Model_s *m = <Model_s *>models
    cdef State_s *s = <State_s *>states
    cdef const long long *w = <const long long *>which
    cdef const long long *room = <const long long *>rooms
    cdef Py_ssize_t j
    cdef long long k, first
    with nogil:
        for j in range(n):
            k = w[j]
            first = s[k].row
            loop.kernel_arm_put(&m[k], &s[k])
            loop.kernel_path_advance(&m[k], &s[k], room[k])
            if tests:
                loop.kernel_watch_look(&m[k], &s[k], first, s[k].row)


def peek(size_t models, size_t states, size_t which, Py_ssize_t n, size_t spare, size_t shown):
    """Writes the row that the next step of each row would write, and the force of the clay.

    shown: 18 numbers by row; spare: another state.
    """
    cdef Model_s *m = <Model_s *>models
    cdef State_s *s = <State_s *>states
    cdef const long long *w = <const long long *>which
    cdef double *out = <double *>shown
    cdef Py_ssize_t j
    cdef long long k
    with nogil:
        for j in range(n):
            k = w[j]
            loop.kernel_arm_put(&m[k], &s[k])
            loop.kernel_path_show(&m[k], &s[k], <State_s *>spare, out + 18 * k)


def strained(
    size_t models, size_t states, size_t which, Py_ssize_t n, long long rows, double shoulder,
    double elbow, size_t out,
):
    """Counts in how many of the last rows each motor is at its limit; out: two numbers by row."""
    cdef Model_s *m = <Model_s *>models
    cdef State_s *s = <State_s *>states
    cdef const long long *w = <const long long *>which
    cdef long long *found = <long long *>out
    cdef Py_ssize_t j
    cdef long long k
    with nogil:
        for j in range(n):
            k = w[j]
            found[2 * k] = loop.kernel_watch_strained(&m[k], &s[k], rows, 0, shoulder)
            found[2 * k + 1] = loop.kernel_watch_strained(&m[k], &s[k], rows, 1, elbow)


def finish(size_t models, size_t states, size_t outs, Py_ssize_t n, size_t starts, long room):
    """Makes runs from start to end without their samples; starts: p and v, four numbers by row."""
    cdef Model_s *m = <Model_s *>models
    cdef State_s *s = <State_s *>states
    cdef Summary_s *out = <Summary_s *>outs
    cdef const double *z = <const double *>starts
    cdef Py_ssize_t k
    with nogil:
        for k in range(n):
            loop.kernel_summary_finish(
                &m[k], &s[k], &out[k], z[4 * k], z[4 * k + 1], z[4 * k + 2], z[4 * k + 3], room
            )
