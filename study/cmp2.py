import sys, time, warnings
import numpy as np
import hapticclay as hc
from hapticclay.heart import scene
from hapticclay.model.flow import Flow
P=hc.Profile
def slab(*a,**k): return hc.slab(*a,**k)
S={}
S['cut']=hc.constant_cut(t_max=2.0)
S['hand']=hc.constant_cut(operator=hc.Operator(), force=(2.,0.), t_max=2.0)
S['stiff']=hc.constant_cut(b=9000., t_max=2.0)
S['stiffshape']=hc.constant_cut(b=1e6, t_max=1.5, shaping=True, force=(3.,0.))
S['stiffhand']=hc.constant_cut(b=2e5, t_max=1.5, operator=hc.Operator(spring=200.), force=(12.,0.))
S['yield']=hc.Scenario(clay=hc.Clay(P((.03,),(0,5.),Fy=(0,.5)),P((.03,),(0,5.),Fy=(0,.3))),force=(1.,.5),t_max=1.5)
S['iso']=hc.Scenario(clay=slab(Flow(Fy=.5,b=5.,K=2.,n=.5),.03,.1),force=(1.,.5),t_max=1.5)
S['yieldstiff']=hc.Scenario(clay=slab(Flow(Fy=.5,b=9e4),.03,.1),force=(3.,.5),t_max=1.5,shaping=True)
S['spring']=hc.Scenario(clay=hc.Clay(P((.02,),(0,20.),springs=(hc.Spring(),hc.Spring(k=300.,limit=2.,k1=50.,tau=.1))),P((),(5.,))),force=(3.,1.),t_max=1.5)
S['surf']=hc.Scenario(clay=hc.Clay(P((.02,),(0,20.),springs=(hc.Spring(),hc.Spring(k=3000.,surface=True))),P((),(5.,))),force=(3.,1.),t_max=1.5)
S['turned']=hc.Scenario(clay=hc.Clay(P((.02,),(0,60.)),P((.02,),(0,10.)),angle=.5),force=(2.,1.),t_max=1.5)
S['turnedyield']=hc.Scenario(clay=hc.Clay(P((.02,),(0,60.),Fy=(0,.3)),P((.02,),(0,10.),Fy=(0,.2)),angle=.5),force=(2.,1.),t_max=1.5)
S['growth']=hc.Scenario(clay=hc.Clay(P((.02,.05),(0,50.,100.),growth=(0,0,30.)),P((),(0,))),force=(2.,.2),t_max=1.5)
S['smooth']=hc.Scenario(clay=hc.Clay(hc.Smooth((0,.1),(-.1,.1),((10.,20.),(30.,80.),(5.,5.))),hc.Smooth((0,.1),(-.1,.1),((10.,20.),(30.,80.)))),force=(2.,.2),t_max=1.5)
S['form']=hc.Scenario(compensator=hc.Compensator((1.,20.),(1.,40.,0.)),clay=slab(90.,.05,.15),force=(3.,.2),t_max=1.5)
S['formlead']=hc.Scenario(compensator=hc.Compensator((.02,1.,3.),(1.,40.,0.)),gain=(.2,.1),clay=slab(90.,.05,.15),force=(3.,.2),t_max=1.5)
S['sat']=hc.constant_cut(b=300.,torque_limit=(.5,.5),force=(6.,0.),t_max=2.)
S['groove']=hc.Scenario(clay=hc.Clay.of_groove(hc.Groove((.02,.08),(-.02,.02),pressure=2e4,damping=1e5)),force=(4.,.5),t_max=1.)
S['grid']=hc.Scenario(clay=hc.Clay(hc.Grid((0.01,.03,.05),(-.01,.01),((0,1,2),(3,4,50),(6,70,8),(9,10,11))),P((),(3.,))),force=(2.,.5),t_max=1.5)
names=sys.argv[1:] or list(S)
if __name__=='__main__':
  for n in names:
    s=S[n]
    t0=time.perf_counter(); ref=hc.simulate(s,engine='python'); t1=time.perf_counter()
    try:
        rows,cr,stops,st,parts=scene.run(s)
    except Exception as ex:
        import traceback; traceback.print_exc(); print(n,'FAILED',ex); continue
    t2=time.perf_counter()
    m=min(len(rows),len(ref.p))
    d=lambda a,b: float(np.abs(a-b).max()) if len(a) else 0
    work=st.work
    en=ref.energy
    print(f"{n:12s} {ref.outcome.code:12s} n {len(ref.p)} {len(rows)} p {d(rows[:m,2:4],ref.p[:m]):.1e} v {d(rows[:m,4:6],ref.v[:m]):.1e} fh {d(rows[:m,6:8],ref.fh[:m]):.1e} tau {d(rows[:m,8:10],ref.tau[:m]):.1e} delta {d(rows[:m,10:12],ref.delta[:m]):.1e} cross {len(cr)} {len(ref.crossings)} {max([abs(a[2]-b.time) for a,b in zip(cr,ref.crossings)],default=0):.1e} stops {len(stops)} {len(ref.stops)} E {abs(work.clay-en['clay']):.1e} {abs(work.motors-en['motors']):.1e} thr {work.through:.2g} old {t1-t0:.2f}s new {t2-t1:.2f}s")
