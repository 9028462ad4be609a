cimport cython
from .records cimport Kick, Model
from ..formulas cimport cmath as math

cdef long MOST
cdef double CLOSE

cdef void find(Model m, Kick k) noexcept nogil
@cython.locals(a=cython.double)
cdef void put_matrix(Model m, Kick k) noexcept nogil
@cython.locals(torque=cython.double)
cdef double pushed(Model m, Kick k, long j) noexcept nogil
@cython.locals(a=cython.double)
cdef void rates(Model m, Kick k) noexcept nogil
cdef long wrong(Model m, Kick k) noexcept nogil
