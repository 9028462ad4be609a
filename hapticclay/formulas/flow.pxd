cimport cython
from . cimport cmath as math

cdef long KICK_PARTS, AXIS_ROUNDS
cdef double CLOSE

cdef double moving_force(double Fy, double K, double n, double speed) noexcept nogil
cdef (double, double) motion_force((double, double, double, double, double, double) law, bint along, double vx, double vy) noexcept nogil
cdef double thinned(double q, double k, double n) noexcept nogil
cdef double implicit_share(double z) noexcept nogil
@cython.locals(stops=cython.bint)
cdef double sliding_force(double a, double end, double slope, double Fy, double K, double n) noexcept nogil
@cython.locals(first=cython.bint)
cdef (double, double, double, double, double, double, double, double, double, double) resist_axes((double, double, double, double) B, (double, double) v, (double, double) end, (double, double, double, double, double, double) law, double sample) noexcept nogil
@cython.locals(stuckx=cython.bint, stucky=cython.bint)
cdef (double, double, bint, bint) forces_on_axes((double, double, double, double) B, (double, double) v, (double, double) d, double left, (double, double, double, double, double, double) law) noexcept nogil
@cython.locals(first=cython.bint, stuck=cython.bint)
cdef (double, double, double, double, double, double, double, double, double, double) resist_along((double, double, double, double) B, (double, double) v, (double, double) end, (double, double, double, double, double, double) law, double sample) noexcept nogil
@cython.locals(stops=cython.bint)
cdef (double, double, double) force_along((double, double, double, double) B, (double, double) v, (double, double) d, (double, double) hold, double left, double Fy, double K, double n) noexcept nogil
cdef (double, double) slowed((double, double, double, double) B, double qx, double qy, double k, double Fy, double K, double n) noexcept nogil
