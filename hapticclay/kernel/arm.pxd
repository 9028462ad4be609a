from .records cimport Instant, Kick, Model, Point, State
from ..formulas cimport cmath as math
from ..formulas cimport arm as law
from . cimport dynamics, joints

cdef (double, double) place(Model m, double q1, double q2) noexcept nogil
cdef (double, double) here(Model m, State s) noexcept nogil
cdef void put_handle(Model m, State s, Kick k) noexcept nogil
cdef void handle_at(Model m, Kick k, double q1, double q2, double r1, double r2) noexcept nogil
cdef void turning(Kick k, double r1, double r2) noexcept nogil
cdef void at_rates(Kick k, double w1, double w2) noexcept nogil
cdef void link_torques(Model m, Kick k) noexcept nogil
cdef (double, double) pushed(Model m, double *u, double t1, double t2) noexcept nogil
cdef double clipped(double tau, double limit) noexcept nogil
cdef void step_engine(Model m, State s, Kick k, double h, bint even) noexcept nogil
cdef void put(Model m, State s) noexcept nogil
cdef (double, double) accelerations(Model m, Point z, Instant now) noexcept nogil
