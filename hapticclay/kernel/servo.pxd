from .records cimport Kick, Model, State
from ..formulas cimport compensator
from ..formulas cimport controller
from . cimport arm
from . cimport memory

cdef void prepare_form(Model m, State s, Kick k) noexcept nogil
cdef void output(Model m, State s, Kick k) noexcept nogil
cdef (double, double) output_now(Model m, long i, double delta, double *z) noexcept nogil
cdef void advance_states(Model m, State s, Kick k, long i) noexcept nogil
cdef void state_rates(Model m, long i, double *z, double f, double *out) noexcept nogil
cdef void advance(Model m, State s, Kick k) noexcept nogil
cdef void take(Model m, State s, Kick k) noexcept nogil
cdef void put_mobility(Model m, Kick k) noexcept nogil
cdef void servo_law(Model m, State s, Kick k) noexcept nogil
cdef void torque_law(Model m, Kick k, double t1, double t2) noexcept nogil
cdef (double, double) solve(Kick k) noexcept nogil
cdef (double, double) acceleration(Model m, long i, double delta, double y, double yrate, double p, double v, double c) noexcept nogil
