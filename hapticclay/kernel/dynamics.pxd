from .records cimport Engine

cdef void put_inertia(Engine e) noexcept nogil
cdef void step(Engine e) noexcept nogil
