import sys; sys.path.insert(0,'/work/try/pk')
exec(open('/work/try/cmp3.py').read().split("names=[a")[0])
import drag
from hapticclay.heart import laws, compiled
laws.TABLE.append(drag); drag.ON[0]=drag.Part(40.,.1,.2)
for dt in (1e-3,5e-4,2.5e-4):
    s=hc.Scenario(clay=hc.slab(5.,.0,.2),force=(1.,.3),t_max=1.0,dt=dt)
    r,w=nrun.completed(s,1,nrun.PLAIN,nrun.EngineStore(nrun.PLAIN)); a=r.arrays(); print(dt,a['p'][-1],a['fe'][-1], r.balance()['residual'])
r2,w=nrun.completed(s,1,compiled.KERNEL,nrun.EngineStore(compiled.KERNEL)); b=r2.arrays(); print({k:np.array_equal(a[k],b[k]) for k in a}, r.outcome, compiled.met)
