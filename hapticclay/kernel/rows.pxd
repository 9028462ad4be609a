cimport cython
from .records cimport Kick, Model, State
from ..formulas cimport arm as arm_law
from . cimport hand
from . cimport joints
from . cimport kick
from . cimport laws
from . cimport ledger
from . cimport own_laws
from . cimport sampled
from . cimport springs
from . cimport viscous

cdef long ROW

@cython.locals(yields=cython.bint)
cdef void write(Model m, State s, Kick k, double after) noexcept nogil
cdef void write_force(Model m, State s, Kick k, long end, double vx, double vy, double fx, double fy) noexcept nogil
cdef void repeat(Model m, State s, Kick k, double after) noexcept nogil
cdef (double, double, double, double) arrived(Model m, State s, double vx, double vy, double fx, double fy) noexcept nogil
cdef void keep(Model m, State s, Kick k, double after, bint shows, bint works) noexcept nogil
