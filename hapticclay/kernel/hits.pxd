cimport cython
from .records cimport Kick, Model, State
from ..formulas cimport cmath as math
from . cimport kick
from . cimport ledger
from . cimport memory
from . cimport viscous

cdef double GROWTH

@cython.locals(halved=cython.bint)
cdef double first_step(Model m, State s, double after) noexcept nogil
cdef void swap(Model m, State s, Kick e) noexcept nogil
cdef void grow(Model m, State s) noexcept nogil
