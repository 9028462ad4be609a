from ..formulas cimport arm
from ..formulas cimport damping
from ..formulas cimport flow
from ..formulas cimport numbers
from ..formulas cimport spring

cdef void fill(double *links, double *out) noexcept nogil
