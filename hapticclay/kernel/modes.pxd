cimport cython
from .records cimport Grip, Instant, Kick, Model, Point, State
from ..formulas cimport cmath as math
from ..formulas cimport arm as arm_law
from ..formulas cimport controller
from ..formulas cimport flow
from . cimport arm
from . cimport servo
from . cimport viscous

cdef long SUBSTEPS
cdef double STABLE_STEP, GRADE, TURN, REST, TURNING, CALM, ALIGNED, RESTS, FREE, REST_MODE, SLIDING, TURNED_IN

cdef bint is_active(State s, long i) noexcept nogil
cdef double strength(State s, long i, double speed) noexcept nogil
cdef double steepness(State s, long i, double speed) noexcept nogil
cdef bint is_rough(State s, long i) noexcept nogil
cdef double creep_speed(double mobility, double dt, double K, double n) noexcept nogil
cdef double slowest(Model m, State s, long i) noexcept nogil
cdef double holding_force(Model m, State s, long i) noexcept nogil
cdef void put(State s, double x, double y) noexcept nogil
cdef void put_way(State s, double mode, double wayx, double wayy) noexcept nogil
cdef bint rests_somewhere(State s) noexcept nogil
cdef bint rests(State s) noexcept nogil
cdef double is_stopped(State s, long i) noexcept nogil
cdef (double, double) velocity(Model m, State s, double q1, double q2, double w1, double w2) noexcept nogil
cdef (double, double) joint_rates(Model m, State s, double q1, double q2, double vx, double vy) noexcept nogil
cdef (double, double) place_of(Model m, double q1, double q2) noexcept nogil
cdef void stop(Model m, State s, Kick k) noexcept nogil
cdef void plain_response(Kick k, Instant out) noexcept nogil
cdef void net(Kick k, Instant out) noexcept nogil
cdef void respond(Model m, State s, Kick k, Instant out) noexcept nogil
cdef (double, double) holding(Grip grip) noexcept nogil
cdef (double, double) remaining_acceleration(double ax, double ay, double *B, double fx, double fy) noexcept nogil
cdef (double, double) resist_axes(State s, Grip grip) noexcept nogil
@cython.locals(slides=cython.bint)
cdef (double, double) resist_along(State s, Grip grip) noexcept nogil
cdef (double, double, double) way_of(State s, double vx, double vy) noexcept nogil
cdef double turning(double *B, double ex, double ey) noexcept nogil
cdef (double, double) acceleration(Grip grip) noexcept nogil
cdef void back_to_rest(Model m, State s, Point z) noexcept nogil
cdef double shortest_step(Model m, State s) noexcept nogil
cdef double share_of_speed(double share, double speed, double rate) noexcept nogil
cdef double longest_step(Model m, State s, Grip grip, double vx, double vy) noexcept nogil
cdef double longest_of_axis(State s, Grip grip, double v, long i) noexcept nogil
@cython.locals(slides=cython.bint)
cdef double longest_along(State s, Grip grip, double vx, double vy) noexcept nogil
@cython.locals(stays=cython.bint)
cdef bint goes_on(Model m, State s, double h, double vx, double vy) noexcept nogil
cdef bint stays_along(Model m, State s, Grip begin, Grip last) noexcept nogil
cdef bint axis_stays(Model m, State s, double v, double begin, double f, long i) noexcept nogil
cdef double gap(Model m, State s, Grip grip, long i) noexcept nogil
cdef double gap_of_hold(double most, double f) noexcept nogil
cdef double violation(Model m, State s, Grip grip, long i) noexcept nogil
cdef bint is_nearly_at_rest(Model m, State s, Grip grip, long i) noexcept nogil
cdef bint nearly_rests(Model m, State s, long i, double speed, double forward, double size, double need) noexcept nogil
cdef (double, double) direction_of_onset(State s, Grip grip) noexcept nogil
cdef bint is_turned_in(Model m, State s, Grip grip, double ex, double ey) noexcept nogil
cdef (double, double) turned_in(State s, Grip grip, double speed, double ex, double ey) noexcept nogil
