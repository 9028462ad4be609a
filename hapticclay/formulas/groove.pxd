from . cimport cmath as math
from . cimport numbers

cdef long SECTORS, RIM
cdef double TOUCHING, SOFT, STRIDE
cdef double HALF[16]

cdef (double, double) outside(double u) noexcept nogil
cdef void cut(double *grid, double *left, double *relief, double x, double y, long disc, double *rim, double *removed) noexcept nogil
cdef void add(double *removed, double volume) noexcept nogil
cdef long sector(double x, double y) noexcept nogil
cdef (double, double) resistance(double *rim, double x, double y) noexcept nogil
