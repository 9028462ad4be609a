cimport cython
from .records cimport Kick, Model, State, StateAxis
from ..formulas cimport cmath as math
from ..formulas cimport regions
from ..formulas cimport spring as law

cdef double NEAR

cdef double force(State s, long i, double L) noexcept nogil
cdef void load(State s, Kick k) noexcept nogil
cdef bint pulls(Model m, StateAxis z, double f) noexcept nogil
cdef bint let_go(Model m, State s, Kick k) noexcept nogil
cdef void put_freed(Kick k) noexcept nogil
cdef double added(Model m, State s, long i, double L, double damping, double f) noexcept nogil
cdef double beside(Model m, State s, long i, double damping) noexcept nogil
cdef bint is_outside(StateAxis z, double p) noexcept nogil
cdef double longest_step(State s, double after) noexcept nogil
cdef double force_for_controller(Model m, State s, long i, double p) noexcept nogil
cdef void move(Model m, State s, double px, double py, double h) noexcept nogil
cdef long dent_place(Model m, State s, long i) noexcept nogil
cdef void enter(Model m, State s, double px, double py, long crossed) noexcept nogil
@cython.locals(up=cython.bint)
cdef (double, double) rest_on_entry(double *table, StateAxis z, long at, double p, bint crosses, bint begins) noexcept nogil
