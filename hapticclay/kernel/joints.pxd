cimport cython
from .records cimport Kick, Model, State
from ..formulas cimport cmath as math
from . cimport dynamics, hand

cdef void sense(Model m, State s) noexcept nogil
cdef void gather(Model m, double *J, double *A) noexcept nogil
cdef void turn(Model m, Kick k, double *rates, double *g, double h) noexcept nogil
cdef void put_centripetal(Model m, Kick k) noexcept nogil
cdef void place(Model m, Kick k, double *of) noexcept nogil
cdef void handle_velocity(Model m, Kick k, double *J, double *rates) noexcept nogil
@cython.locals(out=cython.double)
cdef double along(Model m, double *J, long i, double *x, long at) noexcept nogil
cdef void handle_at(Model m, State s, Kick k) noexcept nogil
cdef (double, double) place_after(Model m, State s, double after) noexcept nogil
cdef void before_kick(Model m, State s, Kick k) noexcept nogil
@cython.locals(change=cython.double)
cdef void from_event(Model m, State s, Kick k) noexcept nogil
cdef void at_event(Model m, Kick k) noexcept nogil
@cython.locals(x=cython.double)
cdef double damping(Model m, double *w, long i) noexcept nogil
cdef double drag(Model m, long i) noexcept nogil
cdef void factor_inertia(Model m, double h) noexcept nogil
@cython.locals(x=cython.double)
cdef void factor(double *A, long at, long n) noexcept nogil
cdef void solve(double *L, long of, double *x, long at, long n) noexcept nogil
cdef void put_mobility(Model m, Kick k) noexcept nogil
cdef double mobility(Model m, long i, long j) noexcept nogil
cdef void eliminate(Kick k, double d) noexcept nogil
@cython.locals(x=cython.double)
cdef void answer(Model m, Kick k) noexcept nogil
cdef void put_rates_after(Model m, Kick k) noexcept nogil
cdef void sensed_handle(Model m, State s, Kick k) noexcept nogil
cdef void prepare_sensor(Model m, State s, Kick k) noexcept nogil
cdef double force_along_z(Model m, Kick k, double fx, double fy, double ax, double ay) noexcept nogil
cdef void step(Model m, State s, Kick k, double h) noexcept nogil
cdef long width(Model m) noexcept nogil
cdef void write(Model m, State s, Kick k, double share) noexcept nogil
