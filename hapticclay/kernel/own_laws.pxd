from .records cimport Kick, Model

cdef void load(Model m, Kick k) noexcept nogil
cdef void move(Model m, double px, double py, double vx, double vy, double h) noexcept nogil
cdef (double, double) force(Model m, double px, double py, double vx, double vy, double since) noexcept nogil
