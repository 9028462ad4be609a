cdef (double, double) feedback_law(double *servo, double delta, double y, double yd, double p, double v, double c) noexcept nogil
cdef (double, double, double, double) velocity_per_force((double, double) n, (double, double, double) W, (double, double, double) d) noexcept nogil
cdef (double, double) along_axes(double c, double s, double x, double y) noexcept nogil
