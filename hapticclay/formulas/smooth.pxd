from . cimport numbers

cdef double smooth_damping(double *table, long at, double x, double y) noexcept nogil
