cimport cython
from .records cimport Model, State
from ..formulas cimport cmath as math
from ..formulas cimport regions
from . cimport arm
from . cimport borders
from . cimport ends
from . cimport hits
from . cimport laws
from . cimport march
from . cimport memory
from . cimport methods
from . cimport rows
from . cimport sampled
from . cimport springs
from . cimport viscous

cdef long OPEN, FINISHED, TIME_LIMIT, NOT_FINITE, UNRESOLVED, MOST_RETURNS, MOST_STEPS

cdef double grid_after(Model m, long long i) noexcept nogil
@cython.locals(on_grid=cython.bint)
cdef (double, double, bint) next_sample(Model m, State s) noexcept nogil
cdef (double, double, bint) next_stop(Model m, State s) noexcept nogil
cdef void begin(State s, double after, bint on_grid) noexcept nogil
cdef void take(Model m, State s, double after, double target) noexcept nogil
cdef void cross(Model m, State s, long i, long up) noexcept nogil
cdef double bound(Model m, State s, double after) noexcept nogil
cdef (double, long, long, bint) try_step(Model m, State s, double after, long overx, long overy, bint first) noexcept nogil
cdef (double, long, long, bint) border_ahead(Model m, State s, double after, double herex, double herey, long overx, long overy) noexcept nogil
@cython.locals(first=cython.bint)
cdef void step_to_event(Model m, State s) noexcept nogil
cdef bint may_step_whole(Model m, State s) noexcept nogil
@cython.locals(fits=cython.bint)
cdef bint has_room(Model m, State s, long room) noexcept nogil
cdef bint ends_in_region(Model m, State s, double after) noexcept nogil
cdef bint whole_step(Model m, State s) noexcept nogil
cdef void whole_steps(Model m, State s, long room) noexcept nogil
cdef void accurate_whole_steps(Model m, State s, long room) noexcept nogil
cdef void advance(Model m, State s, long room) noexcept nogil
cdef void peek(Model m, State s, State spare) noexcept nogil
cdef void show(Model m, State s, State spare, double *out) noexcept nogil
