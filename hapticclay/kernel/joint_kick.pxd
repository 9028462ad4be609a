cimport cython
from .records cimport Kick, Model, State
from . cimport joint_friction
from . cimport joints
from . cimport kick
from . cimport springs

cdef void move_under(Model m, State s, Kick k) noexcept nogil
@cython.locals(x=cython.double)
cdef void put_momentum(Model m, State s, Kick k) noexcept nogil
@cython.locals(load=cython.double)
cdef bint is_touched(Model m, Kick k) noexcept nogil
cdef void drive_alone(Model m, Kick k) noexcept nogil
cdef void put_free_rates(Model m, Kick k) noexcept nogil
@cython.locals(x=cython.double)
cdef void drive(Model m, State s, Kick k) noexcept nogil
