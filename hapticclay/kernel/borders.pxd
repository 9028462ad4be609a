from .records cimport Model, State, StateAxis
from ..formulas cimport regions
from . cimport laws
from . cimport search

cdef double TOUCH

cdef long side(StateAxis z, double p) noexcept nogil
cdef double place_of(State s, long i, long up) noexcept nogil
cdef bint is_identical_beyond(Model m, State s, long i, long up) noexcept nogil
cdef (long, long) border_at_handle(State s, double herex, double herey, long sx, long sy) noexcept nogil
cdef void enter(Model m, State s, long ix, long iy, double px, double py, long crossed, double entered) noexcept nogil
cdef void enter_beyond(Model m, State s, double px, double py, long i, long up, double entered) noexcept nogil
cdef void skip_identical_regions(Model m, State s, double herex, double herey, double px, double py) noexcept nogil
cdef (double, long, long) first_border(Model m, State s, double after, double px, double py, long sx, long sy) noexcept nogil
