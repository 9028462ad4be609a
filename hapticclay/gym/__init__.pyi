# Environments: public names, and the modules they come from.

from .adaptive_gain import AdaptiveGain as AdaptiveGain
from .cut_line import CutLine as CutLine
from .pare_edge import PareEdge as PareEdge
from .probe_clay import ProbeClay as ProbeClay
from .vector import TaskVectorEnv as TaskVectorEnv
