from .numbers cimport whole

cdef double smooth_damping(double *table, long at, double x, double y) noexcept nogil
