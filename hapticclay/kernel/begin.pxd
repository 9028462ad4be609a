from .records cimport Model, State
from ..formulas cimport cmath as math
from ..formulas cimport arm as arm_law
from ..formulas cimport regions
from . cimport arm
from . cimport borders
from . cimport groove
from . cimport hardware
from . cimport joint_law
from . cimport memory
from . cimport methods
from . cimport sampled
from . cimport viscous
from . cimport watch
from . cimport yielding

cdef void begin(Model m, State s, double px, double py, double vx, double vy) noexcept nogil
cdef void put_joints(Model m, State s, double px, double py, double vx, double vy) noexcept nogil
cdef void put_axis(Model m, State s, long i, double p, double v) noexcept nogil
cdef void put_clay(Model m, State s, double px, double py) noexcept nogil
cdef void put_machine(Model m, State s, double px, double py) noexcept nogil
cdef void fill_angles(Model m, State s) noexcept nogil
cdef void change(Model m, State s) noexcept nogil
