cimport cython
from .records cimport Kick, Model
from . cimport joints

cdef long MOST
cdef double CLOSE

cdef void find(Model m, Kick k) noexcept nogil
@cython.locals(a=cython.double)
cdef void put_matrix(Model m, Kick k) noexcept nogil
@cython.locals(torque=cython.double)
cdef double pushed(Model m, Kick k, long j) noexcept nogil
@cython.locals(slides=cython.bint)
cdef void rates(Model m, Kick k) noexcept nogil
@cython.locals(impulse=cython.double)
cdef double held(Model m, Kick k, long i) noexcept nogil
cdef long wrong(Model m, Kick k) noexcept nogil
