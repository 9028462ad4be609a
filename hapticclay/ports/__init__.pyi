# Ports for other programs: public names, and the modules they come from.

from .buttons import ButtonScript as ButtonScript
from .device import Trajectory as Trajectory
from .exchanges import Exchanges as Exchanges
from .report import LoopReport as LoopReport
from .report import loop_report as loop_report
from .server import DeviceServer as DeviceServer
from .server import serve as serve
from .service import Inverse3 as Inverse3
