cimport cython
from .records cimport Kick, Model, State
from ..formulas cimport arm as arm_law
from . cimport arm
from . cimport hand
from . cimport joints
from . cimport own_laws
from . cimport servo
from . cimport signals
from . cimport springs
from . cimport viscous
from . cimport yielding

cdef void begin(Kick k, double before, double after) noexcept nogil
cdef void take_over(Model m, State s, Kick k) noexcept nogil
cdef void load(Model m, State s, Kick k) noexcept nogil
cdef void end_path(Model m, Kick k) noexcept nogil
cdef void move(Model m, State s, Kick k) noexcept nogil
cdef void damped(Kick k) noexcept nogil
@cython.locals(owing=cython.bint)
cdef void move_in_clay(Model m, State s, Kick k) noexcept nogil
cdef void by_servo(Model m, State s, Kick k, double after) noexcept nogil
cdef bint is_limited(Model m, Kick k) noexcept nogil
cdef double velocity(Model m, Kick k, long i) noexcept nogil
cdef double shown_delta(Kick k, long i) noexcept nogil
