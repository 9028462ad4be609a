from .records cimport Kick, Model, State
from ..formulas cimport flow
from . cimport groove
from . cimport own_laws
from . cimport springs
from . cimport viscous
from . cimport yielding

cdef void enter(Model m, State s, double px, double py, long crossed) noexcept nogil
cdef void moved(Model m, State s, double px, double py, double vx, double vy, double h) noexcept nogil
cdef (double, double) without_clay(Model m, State s, Kick k, double fx, double fy) noexcept nogil
cdef (double, double) force_for_controller(Model m, State s, Kick k) noexcept nogil
cdef (double, double) motion_force(Model m, State s, double vx, double vy, double pullx, double pully) noexcept nogil
