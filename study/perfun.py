import time, collections
from numba.core import event
class L(event.Listener):
    def __init__(s): s.st=[]; s.ex=collections.Counter(); s.n=collections.Counter()
    def on_start(s,e): s.st.append([time.process_time(),0.0])
    def on_end(s,e):
        t0,inner=s.st.pop(); d=time.process_time()-t0
        name=e.data['dispatcher'].py_func.__name__ if 'dispatcher' in e.data else str(e.data)
        s.ex[name]+=d-inner; s.n[name]+=1
        if s.st: s.st[-1][1]+=d
LL=L(); event.register("numba:compile",LL)
SIG=collections.defaultdict(list)
_os=L.on_start
def on_start(s,e):
    _os(s,e)
    SIG[e.data['dispatcher'].py_func.__name__].append(str(e.data.get('args')))
L.on_start=on_start
