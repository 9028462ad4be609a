from libc.string cimport memcpy, memset
from .records cimport State, State_s

cdef extern from "records.h" nogil:
    void copied(...)

cdef inline void copied4(double *to, double *of) noexcept nogil:
    to[0], to[1], to[2], to[3] = of[0], of[1], of[2], of[3]

cdef inline void copied_row(double *to, double *of, long long n) noexcept nogil:
    memcpy(to, of, n * sizeof(double))

cdef inline void cleared(State x) noexcept nogil:
    memset(x, 0, sizeof(State_s))
