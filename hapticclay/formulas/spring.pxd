from . cimport cmath as math

cdef (double, double, double, double) spring_step(double k, double *limit, double way, double rest, double p) noexcept nogil
cdef (double, double, double, double) relaxing_step(double k, double tau, double way, double z, double dp, double h) noexcept nogil
