# Materials: public names, and the modules they come from.

from .model.materials import MATERIALS as MATERIALS
from .model.materials import Material as Material
from .model.materials import material as material
