from . cimport constants

cdef ((double, double), (double, double)) halved_damping((double, double) b0, (double, double) b1, double L, double R) noexcept nogil
cdef (double, double, double, double, double, double, double, double, double) split_damping((double, double) b0, (double, double) b1, double H, double L, double R, double W, double damperx, double dampery) noexcept nogil
cdef (double, double) slow_force((double, double) g, (double, double, double) W, (double, double) share, (double, double) f) noexcept nogil
cdef (double, double) rotated_force(double c, double s, double bx, double by, double vx, double vy) noexcept nogil
cdef (double, double, double) rotated_damping(double c, double s, double bx, double by) noexcept nogil
cdef (double, double) damping_at((double, double) base, (double, double) rate, double t) noexcept nogil
