from .records cimport Kick, Model

cdef void load(Model m, Kick k) noexcept nogil
cdef double resistance(Model m, double p, double v, double c, long i) noexcept nogil
cdef double damping_force(Model m, Kick k, long i) noexcept nogil
cdef double force(Model m, Kick k, long i) noexcept nogil
