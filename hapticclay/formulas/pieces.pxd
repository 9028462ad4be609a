from . cimport cmath as math
from . cimport numbers

cdef long PIECE

cdef (double, double) mean_of_lines(double *table, double t, double h) noexcept nogil
cdef bint has_pieces(double *table) noexcept nogil
cdef long piece_at(double *table, double t) noexcept nogil
cdef (double, double) mean_of_piece(double *table, long j, double t, double h) noexcept nogil
cdef (double, double) value_of_pieces(double *table, double t, double near) noexcept nogil
cdef (double, double) mean_of_pieces(double *table, double t, double h) noexcept nogil
cdef (double, double) mean_of_table(double *table, double t, double h) noexcept nogil
cdef (double, double) value_of_table(double *table, double t, double near) noexcept nogil
