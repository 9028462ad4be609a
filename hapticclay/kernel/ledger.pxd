cimport cython
from .records cimport Kick, Machine, Model, Work
from . cimport hand
from . cimport joints

@cython.locals(power=cython.double)
cdef void add_work(Model m, Work of, Work to, Kick k, double *w, Machine machine) noexcept nogil
cdef (double, double) more_taken(Model m, Kick k, double *w, double hand_taken, double joints_taken) noexcept nogil
@cython.locals(power=cython.double)
cdef void add_hardware_work(Model m, Work of, Work to, Kick k, double *w, Machine machine) noexcept nogil
