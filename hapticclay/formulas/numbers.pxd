from . cimport cmath

cdef inline long long whole(double x) noexcept nogil:
    return <long long>x if -9.0e15 < x and x < 9.0e15 else 0

cdef inline double ratio(double x, double y) noexcept nogil:
    return x / y

cdef inline double power(double x, double y) noexcept nogil:
    return cmath.pow(x, y)

cdef inline double root(double x) noexcept nogil:
    return cmath.sqrt(x)

cdef inline double nearest(double x) noexcept nogil:
    return cmath.rint(x) + 0.0 if -9.0e15 < x and x < 9.0e15 else x
