from . cimport cmath as math
from . cimport flow
from . cimport numbers

cdef double slide(long case) noexcept nogil
cdef double round_to_even(double x, double step) noexcept nogil
cdef double quantize(double x, long bits, double span) noexcept nogil
cdef double encode(double q, double count) noexcept nogil
cdef double velocity_difference(double then, double old, double k, double q, double Ts) noexcept nogil
cdef double low_pass(double y, double mean, double cutoff, double span) noexcept nogil
cdef (double, double) filter_step(double *f, double x0, double x1, double u) noexcept nogil
cdef (double, double) coulomb_friction((double, double) w, double a11, double a12, double a22, double *limit) noexcept nogil
cdef double passivity_controller(double energy, double f, double v, double Ts, double W) noexcept nogil
cdef (double, double) virtual_coupling(double tool, double p, double v, double b, (double, double) coupling, double Ts) noexcept nogil
cdef (double, double, double, double) tool_that_yields((double, double) tool, (double, double) p, (double, double) v, (double, double) b, (double, double, double, double, double, double) law, bint along, (double, double) coupling, double Ts) noexcept nogil
