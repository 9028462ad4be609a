cimport cython
from .records cimport Grip, Model, State
from ..formulas cimport cmath as math
from ..formulas cimport regions
from . cimport instant
from . cimport march
from . cimport modes

cdef Grip evaluate(Model m, State s) noexcept nogil
cdef void set_velocity(Model m, State s, double vx, double vy) noexcept nogil
cdef double choose_modes(Model m, State s, double after) noexcept nogil
cdef (double, bint) first_mode(State s, long i, double v) noexcept nogil
cdef double tried_mode(long j, bint is_open, double ended, double mode) noexcept nogil
@cython.locals(restx=cython.bint, resty=cython.bint)
cdef void choose_axes(Model m, State s) noexcept nogil
@cython.locals(openx=cython.bint, openy=cython.bint)
cdef void fit_modes(Model m, State s, bint restx, bint resty) noexcept nogil
@cython.locals(rests=cython.bint)
cdef void choose_way(Model m, State s) noexcept nogil
