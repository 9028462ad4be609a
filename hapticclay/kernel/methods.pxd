cimport cython
from .records cimport Model, State
from . cimport arm
from . cimport joints
from . cimport kick
from . cimport march
from . cimport onset
from . cimport rows
from . cimport sampled
from . cimport servo
from . cimport signals
from . cimport yielding

cdef long CONTINUOUS, SAMPLED, ACCURATE

cdef void control(Model m, State s) noexcept nogil
cdef void attempt(Model m, State s, double after) noexcept nogil
cdef (double, double) place_after(Model m, State s, double after) noexcept nogil
@cython.locals(total=cython.double)
cdef bint is_sound(Model m, State s) noexcept nogil
cdef void keep(Model m, State s, double after, bint shows) noexcept nogil
@cython.locals(even=cython.bint)
cdef void take(Model m, State s, double after) noexcept nogil
cdef void halt(Model m, State s) noexcept nogil
cdef (double, double) arrive(Model m, State s) noexcept nogil
cdef double pace(Model m, State s, double target, double after, bint on_grid) noexcept nogil
cdef double bound(Model m, State s, double after) noexcept nogil
