from .records cimport Kick, Model, State
from ..formulas cimport pieces

cdef bint is_on_grid(Model m, State s) noexcept nogil
cdef void push(Model m, State s, Kick k) noexcept nogil
cdef (double, double) muscle_in_kick(Model m, State s, Kick k) noexcept nogil
cdef (double, double) push_now(Model m, State s) noexcept nogil
cdef void add_command(Model m, State s, Kick k) noexcept nogil
cdef (double, double) command_over_sample(Model m, State s) noexcept nogil
cdef (double, double) command_change(double *table, double t0, double t1, double h) noexcept nogil
cdef (double, double) push_at(Model m, double t, double near, long row) noexcept nogil
cdef (double, double) command_at(Model m, double t, double near, long row) noexcept nogil
