from .records cimport Model, State
from ..formulas cimport cmath as math
from ..formulas cimport groove as law
from ..formulas cimport numbers

cdef void cut(Model m, double ax, double ay, double x, double y) noexcept nogil
cdef void move(Model m, State s, double px, double py, double vx, double vy) noexcept nogil
cdef void enter(Model m, State s) noexcept nogil
cdef (double, double, double, double, double, double) laws_along(Model m, double x, double y) noexcept nogil
cdef void touch(Model m, double px, double py) noexcept nogil
