from .records cimport Kick, Model, State
from ..formulas cimport cmath as math
from ..formulas cimport hardware as law
from . cimport kick
from . cimport servo

cdef long ROUNDS
cdef double CLOSE, NUDGE

cdef void find(Model m, State s, Kick k, double t1, double t2) noexcept nogil
cdef void drive(Model m, State s, Kick k, double t1, double t2) noexcept nogil
cdef (double, double) linear(Model m, State s, Kick k, double t1, double t2) noexcept nogil
cdef double rate(Model m, State s, Kick k, long i, double f, double t1, double t2) noexcept nogil
cdef double torque_of(Model m, State s, Kick k, long i, double t1, double t2) noexcept nogil
