import collections, time
from numba.core import compiler_machinery as cm
PT=collections.defaultdict(lambda: collections.Counter())
orig=cm.PassManager._runPass
stack=[]
def run(self,index,pss,internal_state):
    name=pss.name(); fn=internal_state.func_id.func_name if getattr(internal_state,'func_id',None) else '?'
    stack.append(0.0); t=time.process_time()
    try: return orig(self,index,pss,internal_state)
    finally:
        d=time.process_time()-t; inner=stack.pop(); PT[fn][name]+=d-inner
        if stack: stack[-1]+=d
cm.PassManager._runPass=run
