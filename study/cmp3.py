import sys, time, warnings
exec(open('/work/try/cmp2.py').read().split("names=")[0].replace("from hapticclay.heart import scene","from hapticclay.heart import scene, run as nrun"))
from hapticclay.simulation import record
names=[a for a in sys.argv[1:] if a!='native'] or list(S)
K=nrun.PLAIN
if 'native' in sys.argv:
    from hapticclay.heart import compiled; K=compiled.KERNEL
for n in names:
    s=S[n]; ref=hc.simulate(s,engine='python')
    store=nrun.EngineStore(K)
    t=time.perf_counter(); r,w=nrun.completed(s,1,K,store); t=time.perf_counter()-t
    a=r.arrays(); d=lambda x,y: float(np.abs(x-y).max()) if len(x)==len(y) and len(x) else (0. if len(x)==len(y) else 'LEN')
    print(f"{n:12s} {ref.outcome.code} {str(r.outcome)==str(ref.outcome)} steps {r.steps==ref.steps} cross {len(r.crossings)==len(ref.crossings)} stops {len(r.stops)==len(ref.stops)} ",{k:d(a[k],getattr(ref,k)) for k in ('t','p','v','fe','tau','q')}, 'E', max(abs(r.balance()[k]-ref.energy[k]) for k in ref.energy), round(t,2))
