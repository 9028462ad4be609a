from .records cimport Model, State
from . cimport arm
from . cimport methods

cdef double kinetic(Model m, State s) noexcept nogil
cdef double of_hand(Model m, State s) noexcept nogil
