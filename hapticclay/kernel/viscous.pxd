cimport cython
from .records cimport Kick, KickAxis, Model, State
from ..formulas cimport arm as arm_law
from ..formulas cimport controller
from ..formulas cimport regions
from ..formulas cimport damping as law

@cython.locals(b0=(cython.double, cython.double), b1=(cython.double, cython.double))
cdef void damp(Model m, State s, Kick k) noexcept nogil
cdef void load(Model m, Kick k) noexcept nogil
cdef double damping(Model m, State s, long i, long before) noexcept nogil
@cython.locals(b=(cython.double, cython.double))
cdef (double, double) damping_at_place(Model m, State s, double t, double px, double py) noexcept nogil
cdef (double, double) force(Model m, double bx, double by, double vx, double vy) noexcept nogil
cdef void age(State s) noexcept nogil
cdef void smoothed(Model m, State s, double px, double py) noexcept nogil
cdef (double, double) along(Model m, double x, double y) noexcept nogil
cdef (double, double) across(Model m, double x, double y) noexcept nogil
cdef (double, double, double, double) rotated_matrix(Model m, (double, double, double, double) B) noexcept nogil
cdef void rest_after_sample(Kick k) noexcept nogil
cdef (double, double) slow_force(Model m, Kick k) noexcept nogil
cdef double velocity_over(KickAxis o, double slow) noexcept nogil
