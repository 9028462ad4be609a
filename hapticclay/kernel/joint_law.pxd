from .records cimport Kick, Model, State
from ..formulas cimport cmath as math
from ..formulas cimport arm as arm_law
from ..formulas cimport hardware as law
from . cimport arm
from . cimport hardware
from . cimport joints
from . cimport laws

cdef long EXACT, DIFFERENCE, FILTER

cdef void respond(Model m, State s, Kick k) noexcept nogil
cdef void measure_rates(Model m, State s) noexcept nogil
cdef void see_pose(Model m, State s) noexcept nogil
cdef void hold_weight(Model m, State s) noexcept nogil
cdef void feed_gravity(Model m, Kick k) noexcept nogil
cdef void render(Model m, State s, Kick k) noexcept nogil
