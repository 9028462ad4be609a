cimport cython
from .records cimport Kick, Machine, Model, Work
from . cimport hand
from . cimport joints

@cython.locals(power=cython.double)
cdef void add_work(Model m, Work of, Work to, Kick k, double *w, Machine machine, double *q) noexcept nogil
@cython.locals(power=cython.double, rate=cython.double, torque=cython.double)
cdef double by_drives(Model m, Kick k, double *w, double *q) noexcept nogil
@cython.locals(way=cython.double)
cdef (double, double) along_z(Model m, Kick k, double muscle, double taken) noexcept nogil
@cython.locals(force=cython.double)
cdef double taken_by_joints(Model m, Kick k, double *w, double taken) noexcept nogil
@cython.locals(power=cython.double)
cdef void add_hardware_work(Model m, Work of, Work to, Kick k, double *w, Machine machine) noexcept nogil
