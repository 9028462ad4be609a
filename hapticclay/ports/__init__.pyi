# Ports for other programs: public names, and the modules they come from.

from .buttons import ButtonScript as ButtonScript
from .client import DeviceClient as DeviceClient
from .client import DeviceSample as DeviceSample
from .client import connect as connect
from .client_log import ClientLog as ClientLog
from .client_log import Timing as Timing
from .coupled import Coupled as Coupled
from .coupled import Rendered as Rendered
from .coupled import render as render
from .device import Trajectory as Trajectory
from .exchanges import Exchanges as Exchanges
from .limits import Limits as Limits
from .pair_ends import PairServers as PairServers
from .pair_ends import serve_pair as serve_pair
from .report import LoopReport as LoopReport
from .report import loop_report as loop_report
from .server import DeviceServer as DeviceServer
from .server import serve as serve
from .sessions import Inverse3 as Inverse3
