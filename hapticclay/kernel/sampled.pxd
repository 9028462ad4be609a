cimport cython
from .records cimport Kick, Machine, MachineAxis, Model, State
from ..formulas cimport cmath as math
from ..formulas cimport arm as arm_law
from ..formulas cimport compensator
from ..formulas cimport controller
from . cimport arm
from . cimport friction
from . cimport hand
from . cimport hardware
from . cimport joint_kick
from . cimport joint_law
from . cimport joints
from . cimport kick
from . cimport laws
from . cimport ledger
from . cimport memory
from . cimport servo
from . cimport signals
from . cimport viscous
from . cimport yielding

cdef long NOT_FINITE
cdef double SLACK, REACTION

cdef bint is_early(State s, double after) noexcept nogil
cdef Machine machine_of(State s, double after) noexcept nogil
cdef void by_hold(Model m, State s, Kick k, double after) noexcept nogil
cdef void across(Model m, State s, Kick k, double after) noexcept nogil
cdef void move_under(Model m, State s, Kick k, Machine machine) noexcept nogil
cdef void from_event(Model m, State s, Kick e, Kick k) noexcept nogil
@cython.locals(samples=cython.bint)
cdef void act(Model m, State s) noexcept nogil
cdef void event(Model m, State s, long samples, double now) noexcept nogil
cdef void rest(Model m, State s, Kick e) noexcept nogil
cdef void put_times(Model m, Machine machine, long long k) noexcept nogil
cdef void sample(Model m, State s) noexcept nogil
cdef void respond(Model m, State s, Kick k, double fx, double fy) noexcept nogil
cdef void sense(Model m, State s, Kick k) noexcept nogil
cdef (double, double) on_sensor(Model m, State s, Kick k, double ux, double uy) noexcept nogil
cdef (double, double) acceleration(Model m, State s, Kick k, double fx, double fy) noexcept nogil
@cython.locals(B=(cython.double, cython.double, cython.double, cython.double))
cdef (double, double) reaction(Model m, State s, Kick k, double fx, double fy) noexcept nogil
cdef void compute(Model m, State s, Kick k, double fx, double fy) noexcept nogil
cdef double output(Model m, MachineAxis z, long i, double f) noexcept nogil
@cython.locals(size=cython.double)
cdef void call_own_controller(Model m, State s, Kick k, double fx, double fy) noexcept nogil
cdef void advance(Model m, State s, long i, double shift) noexcept nogil
cdef void advance_form(Model m, long i, MachineAxis z, MachineAxis to, double shift) noexcept nogil
cdef double form_row(double *c, long j, double *z, double y, double yrate, double start, double f) noexcept nogil
cdef (double, double, double) shown_output(State s, double after) noexcept nogil
cdef void take(Model m, State s) noexcept nogil
cdef void keep_own_state(Model m) noexcept nogil
cdef (double, double) before_event(Model m, State s, double target, double after) noexcept nogil
cdef double first_after(double t, double when, double target) noexcept nogil
