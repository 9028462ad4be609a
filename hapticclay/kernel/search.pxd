cimport cython
from .records cimport Model, State
from . cimport march
from . cimport methods
from . cimport modes

cdef long MODE_X

cdef double gap_after(Model m, State s, double h, long what, double border) noexcept nogil
@cython.locals(leaves=cython.bint, opening=cython.bint, small=cython.bint)
cdef double find_root(Model m, State s, double b, double fb, long what, double border) noexcept nogil
