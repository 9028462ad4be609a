cimport cython
from .records cimport Model, State, Watch
from ..formulas cimport cmath as math
from ..formulas cimport numbers

cdef long SWINGS, QUIET, ROW
cdef double FOLD, SPEED, FLOOR, STILL, SWING_GROWTH, STEP_GROWTH, SWING_SPACING, CYCLE

cdef void begin(Watch w) noexcept nogil
cdef void look(Model m, State s, long long first, long long n) noexcept nogil
@cython.locals(found=cython.longlong, j=cython.longlong)
cdef long long strained(Model m, State s, long long n, long motor, double limit) noexcept nogil
@cython.locals(bound=cython.bint)
cdef bint is_quiet(Model m, Watch w, long at) noexcept nogil
@cython.locals(quiet=cython.bint)
cdef bint swings_quietly(Watch w, long o, double v, double bound) noexcept nogil
@cython.locals(slow=cython.bint)
cdef bint turned(Watch w, long o, double bound) noexcept nogil
