cimport cython
from .records cimport Instant, Model, Point, State, Sums
from ..formulas cimport cmath as math
from . cimport arm
from . cimport instant
from . cimport memory
from . cimport modes
from . cimport yielding

cdef long GROWTH_BLOCK, OPEN, UNRESOLVED, ROW
cdef double TOUCH, NEAR, EVEN, FASTEST

cdef long substeps(Model m, long long i) noexcept nogil
cdef double pace(Model m, State s, double target, double after, bint on_grid) noexcept nogil
cdef long long index_after(double *times, long long count, double t) noexcept nogil
cdef double next_break(Model m, double t) noexcept nogil
cdef (double, double) before_break(Model m, double t, double target, double after) noexcept nogil
cdef bint is_even(Model m, double t, double target) noexcept nogil
cdef long signal_row(Model m, double t, double h) noexcept nogil
@cython.locals(still=cython.bint)
cdef void march(Model m, State s, double h) noexcept nogil
cdef void start(Model m, State s, Point z) noexcept nogil
cdef void keep_start(State s) noexcept nogil
cdef void clear_sums(Sums sums) noexcept nogil
cdef void add_stage(Model m, Sums sums, long i, Instant now, double a1, double a2) noexcept nogil
cdef void move(Model m, Point begin, Point z, Instant now, double a1, double a2, double h) noexcept nogil
cdef void end(Model m, State s, double h) noexcept nogil
cdef (double, double) finish(double x, double v, Sums sums, long i, double h) noexcept nogil
cdef bint is_finite(Point z) noexcept nogil
cdef void write(Model m, State s) noexcept nogil
cdef void take(Model m, State s) noexcept nogil
cdef void age_modes(Model m, State s) noexcept nogil
cdef void evaluate_end(Model m, State s, double h) noexcept nogil
