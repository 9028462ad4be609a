import sys
src=open('/work/try/acc_scenes.py').read()
i=src.index("names="); exec(src[:i])
import time
from hapticclay.heart import run as nrun
sel=[a for a in sys.argv[1:] if a!='native']
names=sel or list(S)
K=nrun.PLAIN
if 'native' in sys.argv:
    from hapticclay.heart import compiled; K=compiled.KERNEL
for n in names:
    s=S[n]
    try:
        ref=hc.simulate(s,engine='python')
        t=time.perf_counter(); r,w=nrun.completed(s,1,K,nrun.EngineStore(K)); t=time.perf_counter()-t
    except Exception as ex:
        print(n,'FAILED',type(ex).__name__,str(ex)[:200]); 
        if sel: raise
        continue
    a=r.arrays(); d=lambda x,y: float(np.abs(x-y).max()) if len(x)==len(y) and len(x) else (0. if len(x)==len(y) else 'LEN')
    D={k:d(a[k],getattr(ref,k)) for k in ('t','p','v','fh','fe','tau','delta','q')}
    B=r.balance(); E=max([abs(B[k]-ref.energy[k]) for k in ref.energy]) if set(B)==set(ref.energy) else set(B)^set(ref.energy)
    ok=all(x!='LEN' and x<1e-9 for x in D.values()) and not isinstance(E,set) and E<1e-10 and str(r.outcome)==str(ref.outcome) and r.steps==ref.steps and len(r.stops)==len(ref.stops) and len(r.crossings)==len(ref.crossings)
    print(f"{n:16s} {'ok ' if ok else 'BAD'} p {D['p'] if D['p']=='LEN' else '%.0e'%D['p']} {ref.outcome.code} {'' if ok else (D,E,r.steps,ref.steps,len(r.stops),len(ref.stops),str(r.outcome))} {t:.1f}",flush=True)
