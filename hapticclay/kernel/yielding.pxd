cimport cython
from .records cimport Kick, KickAxis, Model, State
from ..formulas cimport cmath as math
from ..formulas cimport controller
from ..formulas cimport regions
from ..formulas cimport flow as law
from . cimport groove
from . cimport viscous

cdef double LINE
cdef double TRACE

cdef (double, double, double) law_now(Model m, State s, Kick k, long i, double speed) noexcept nogil
cdef bint is_same(State s) noexcept nogil
cdef (double, double, double, double, double, double) laws_now(Model m, State s, Kick k, double vx, double vy) noexcept nogil
cdef (double, double, double, double, double, double) laws_in_kick(Model m, State s, Kick k, (double, double, double, double) B, double vx, double vy, double ux, double uy) noexcept nogil
cdef (double, double, double, double, double, double) laws_of_motion(Model m, State s, double vx, double vy) noexcept nogil
cdef (double, double, double, double, double, double, double, double, double, double) resist_by(Model m, (double, double, double, double) B, (double, double) v, (double, double) end, (double, double, double, double, double, double) fyk, double L) noexcept nogil
cdef (double, double, double, double) of_plane((double, double, double, double) B) noexcept nogil
cdef bint flows_freely(Model m, State s) noexcept nogil
@cython.locals(B=(cython.double, cython.double, cython.double, cython.double))
cdef void resist(Model m, State s, Kick k) noexcept nogil
cdef void flow_on(Kick k) noexcept nogil
cdef double return_velocity(KickAxis o, double place, double on) noexcept nogil
cdef void settle(Kick k, KickAxis o, double place, double w, double Fy, double stop) noexcept nogil
cdef (double, double) creeping(Model m, State s, Kick k, double gx, double gy) noexcept nogil
cdef double creep(double size, double b, double Fy, double K, double n, double g) noexcept nogil
cdef double velocity(Model m, Kick k, long i) noexcept nogil
cdef double sample_velocity(Model m, Kick k, long i) noexcept nogil
cdef void enter(Model m, State s) noexcept nogil
cdef void age(State s) noexcept nogil
cdef void note(Model m, State s, Kick k) noexcept nogil
cdef void note_stop(Model m, State s, double axis, double starts, double after) noexcept nogil
