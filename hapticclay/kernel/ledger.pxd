from .records cimport Kick, Machine, Model, Work
from . cimport hand

cdef void add_work(Model m, Work of, Work to, Kick k, double w1, double w2, Machine machine) noexcept nogil
cdef void add_hardware_work(Model m, Work of, Work to, Kick k, double w1, double w2, Machine machine) noexcept nogil
