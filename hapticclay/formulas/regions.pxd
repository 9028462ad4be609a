from . cimport numbers
from . cimport smooth

cdef long END, EDGES, LANDED, OWN, SMOOTH, VALUES, RATES, ENTERED, FLOWS, SPRINGS, HEAD, SPRING

cdef (long, long) region_of(double *table, (double, double) p) noexcept nogil
cdef long _region_along(double *table, long i, double at) noexcept nogil
cdef ((double, double), (double, double), (double, double), (double, double)) enter_region(double *table, long ix, long iy, double t) noexcept nogil
cdef (double, double, double) enter_flow(double *table, long axis, long ix, long iy) noexcept nogil
cdef long spring_place(double *table, long axis, long ix, long iy) noexcept nogil
cdef (double, double) smooth_clay(double *table, long which, double x, double y, double bx, double by) noexcept nogil
cdef bint is_identical(double *table, long ix, long iy, long i, long up) noexcept nogil
cdef long _cell(double *table, long axis, long ix, long iy) noexcept nogil
cdef (double, double) _cell_law(double *table, long axis, long ix, long iy, double t) noexcept nogil
