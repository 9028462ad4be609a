cimport cython
from .records cimport Grip, Model, State
from ..formulas cimport cmath as math
from . cimport march
from . cimport methods
from . cimport modes
from . cimport search

cdef void put_ends(State s, double endx, double endy) noexcept nogil
cdef bint leaves_mode(Model m, State s, double vx, double vy) noexcept nogil
@cython.locals(strays=cython.bint)
cdef (double, bint) shorten_to_end(Model m, State s, double after) noexcept nogil
cdef double end_of_mode(Model m, State s, Grip grip, long i) noexcept nogil
cdef bint may_end(Model m, State s, double v, long i) noexcept nogil
cdef bint is_calm(Model m, State s, double after) noexcept nogil
