from .records cimport Instant, Kick, Model, Point, State
from ..formulas cimport cmath as math
from ..formulas cimport arm as arm_law
from . cimport arm
from . cimport hand
from . cimport modes
from . cimport own_laws
from . cimport servo
from . cimport signals
from . cimport viscous

cdef void evaluate(Model m, State s, Point z, double since, long row, Instant out) noexcept nogil
cdef void servo_law(Model m, Kick k, Point z) noexcept nogil
cdef void torque_law(Model m, Kick k, double t1, double t2) noexcept nogil
cdef void compute_torques(Model m, Kick k, Instant out) noexcept nogil
cdef void finish(Model m, Kick k, Point z, Instant out) noexcept nogil
cdef void powers(Model m, Kick k, Point z, Instant out) noexcept nogil
cdef void hold(Model m, State s, Kick k, Instant out) noexcept nogil
cdef double side(long case) noexcept nogil
cdef (double, double) requested_under(Model m, State s, Kick k, Instant out, (double, double, double, double, double) law, double t1, double t2) noexcept nogil
