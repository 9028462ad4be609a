import sys, time, dataclasses, warnings
import numpy as np
import hapticclay as hc
from hapticclay.heart import scene
from hapticclay.model.flow import Flow
from hapticclay.model.clay import Clay, Profile
P=hc.Profile
import importlib.util
def slab(*a,**k): return hc.slab(*a,**k)
A=dict(integrator='accurate')
S={}
S['cut']=hc.constant_cut(t_max=1.5,**A)
S['hand']=hc.constant_cut(operator=hc.Operator(), force=(2.,0.), t_max=1.,**A)
S['shaped']=hc.constant_cut(shaping=True,t_max=1.,**A)
S['offaxis']=hc.constant_cut(force=(1.,.3),t_max=1.,**A)
S['stiff']=hc.constant_cut(b=9000., t_max=.5,**A)
S['handstiff']=hc.constant_cut(b=3000., operator=hc.Operator(spring=200.),force=(12.,0.), t_max=.5,**A)
S['sat']=hc.constant_cut(b=300.,torque_limit=(.5,.5),force=(6.,0.),t_max=1.,**A)
S['satshape']=hc.constant_cut(b=300.,torque_limit=(.5,.5),force=(6.,0.),t_max=1.,shaping=True,operator=hc.Operator(),**A)
S['turned']=hc.Scenario(clay=hc.Clay(P((.02,),(0,60.)),P((.02,),(0,10.)),angle=.5),force=(2.,1.),t_max=.8,**A)
S['smooth']=hc.Scenario(clay=hc.Clay(hc.Smooth((0,.1),(-.1,.1),((10.,20.),(30.,80.),(5.,5.))),hc.Smooth((0,.1),(-.1,.1),((10.,20.),(30.,80.)))),force=(2.,.2),t_max=.8,**A)
S['growth']=hc.Scenario(clay=hc.Clay(P((.02,.05),(0,50.,100.),growth=(0,0,30.)),P((),(0,))),force=(2.,.2),t_max=.8,**A)
NOC=hc.Profile((), (0.0,))
S['growing']=hc.Scenario(clay=hc.Clay(hc.Profile((), (50.0,), growth=(6e4,)), NOC),gain=(1.0, 0.1), force=(3.0, 0.0), shaping=True, t_max=0.3, **A)
S['growing1ms']=dataclasses.replace(S['growing'],dt=1e-3)
S['growstop']=dataclasses.replace(S['growing'],clay=hc.Clay(hc.Profile((), (50.0,), growth=(5e7,)), NOC),dt=1e-4,t_max=.2)
S['grid']=hc.Scenario(clay=hc.Clay(hc.Grid((0.01,.03,.05),(-.01,.01),((0,1,2),(3,4,50),(6,70,8),(9,10,11))),P((),(3.,))),force=(2.,.5),t_max=1.,**A)
S['form']=hc.Scenario(compensator=hc.Compensator((1.,20.),(1.,40.,0.)),clay=slab(90.,.05,.15),force=(3.,.2),t_max=1.,**A)
S['formlead']=hc.Scenario(compensator=hc.Compensator((.02,1.,3.),(1.,40.,0.)),gain=(.2,.1),clay=slab(90.,.05,.15),force=(3.,.2),t_max=1.,**A)
S['free']=hc.free(shaping=True,dt=2e-3,t_max=.1234567,**A)
S['unstable']=hc.constant_cut(gain=(1.0, 1.0), dt=1e-3,t_max=5.,**A)
OTHER = dict(arm=hc.Arm(0.3, 0.25, 0.05, 0.4),servo=(
        hc.Servo(hc.SecondOrder(500.0, 30.0, 800.0), hc.SecondOrder(1.3, 25.0, 300.0)),
        hc.Servo(hc.SecondOrder(900.0, 55.0, 600.0), hc.SecondOrder(0.2, 40.0, 700.0))))
HANDS = hc.Operator(0.4, 3.0, 5.0), hc.Operator(0.1, 7.0, 20.0)
ZEROS = (hc.Compensator((0.3, 2.0), (1.0, 12.0, 0.0)),hc.Compensator((0.02, 1.0, 40.0, 30.0), (1.0, 14.0, 140.0, 400.0)))
S['all']=dataclasses.replace(hc.constant_cut(),compensator=ZEROS,operator=HANDS,force=(2.,.3),t_max=.8,dt=1e-3,**OTHER,**A)
LAYERSV = Clay(Profile((0.01, 0.03), (0.0, 90.0, 30.0), "x"), Profile((0.01,), (40.0, 120.0), "y", (0.0, 9.0)))
S['layers']=dataclasses.replace(hc.free(force=(1.5, 0.7)), clay=LAYERSV,t_max=.8,dt=1e-3,**A)
# --- borders
S['border']=hc.Scenario(clay=hc.Clay(hc.Profile((), (40.0,)), hc.Profile((0.01,), (1.0, 600.0), "y"), angle=-0.97),force=(16.0, 5.0), gain=(1.0, 0.4), dt=3.6e-4, t_max=0.2,**A)
# --- yields
S['yield']=hc.Scenario(clay=hc.Clay(P((.03,),(0,5.),Fy=(0,.5)),P((.03,),(0,5.),Fy=(0,.3))),force=(1.,.5),t_max=.8,**A)
S['iso']=hc.Scenario(clay=slab(Flow(Fy=.5,b=5.,K=2.,n=.5),.03,.1),force=(1.,.5),t_max=.8,**A)
S['turnedyield']=hc.Scenario(clay=hc.Clay(P((.02,),(0,60.),Fy=(0,.3)),P((.02,),(0,10.),Fy=(0,.2)),angle=.5),force=(2.,1.),t_max=.8,**A)
S['limit']=hc.Scenario(clay=hc.Clay(hc.Profile((), (46.4,), Fy=(9.92,)), hc.Profile((), (31.6,), Fy=(0.231,)), angle=1.19),force=(-12.9, -4.06), gain=(0.436, 0.0865), torque_limit=(0.11, 2.38), dt=6.36e-4,t_max=0.2, shaping=True, length=None,**A)
S['left']=hc.Scenario(clay=hc.slab(hc.Flow(Fy=1.0, b=5.0), 0.02, 0.1), gain=(0.5, 0.0), force=(4.0, 0.0),t_max=.6, dt=2e-3, shaping=True,**A)
def slider(flow, dt, t_max):
    base = hc.free()
    servo = tuple(hc.Servo(x.G, hc.SecondOrder(1.0 / 1.25, 1e-9, 1e-9)) for x in base.servo)
    return dataclasses.replace(base, clay=hc.slab(flow), gain=(0.0, 0.0), shaping=True, servo=servo, velocity=(.2, 0.0),
        start=(0.02, 0.0), force=(0.0, 0.0), compensator=hc.Compensator((1,), (1, 0, 0)), dt=dt, t_max=t_max, length=None, torque_limit=(1e5, 1e5), stop=False,**A)
for i,(f,t) in enumerate([(hc.Flow(Fy=2.0, b=5.0),.2),(hc.Flow(Fy=2.0),.2),(hc.Flow(K=3.0, n=0.5),.6),(hc.Flow(K=1.5, n=0.23),.4),(hc.Flow(Fy=1.0, K=1.0, n=0.5, b=2.0),.3),(hc.Flow(Fy=0.5, K=4.0, n=2.0),.6),(hc.Flow(Fy=0.5, K=4.0, n=1.5, b=1.0),.6)]):
    S[f'slider{i}']=slider(f,1e-3,t)
HAND=(.25,2.,6.)
BINGHAM = (((0.5, 0.0, 1.0, 5.0), (0.3, 0.0, 1.0, 9.0)),)
ALIKE = (((0.5, 0.0, 1.0, 5.0),) * 2,)
NONE = ((0.0, 0.0, 1.0, 0.0),) * 2
LAYERS = (NONE,((0.6, 0.0, 1.0, 9.0), (0.4, 0.0, 1.0, 9.0)),((0.0, 0.0, 1.0, 20.0),) * 2,((2.0, 0.0, 1.0, 9.0), (1.0, 0.0, 1.0, 9.0)))
MOVING = dict(uh=(0.1, 0.05), v0=(0.1, -0.05), t_end=0.5)
BACK = dict(uh=(-1.5, 0.8), v0=(0.1, -0.05), t_end=0.5)   # stops, and is pushed back
PUSHED = dict(uh=(1.,.4), t_end=.5)
SLOW = dict(isotropic=True)
THINNING = ((0.3, 3.0, 0.5, 2.0), (0.2, 2.0, 0.7, 2.0))
CASES = {
    "coulomb": dict(laws=(((0.5, 0.0, 1.0, 0.0), (0.3, 0.0, 1.0, 0.0)),), **MOVING),
    "bingham": dict(laws=BINGHAM, **PUSHED),
    "bingback": dict(laws=BINGHAM, **BACK),
    "binghold": dict(laws=BINGHAM, **MOVING),
    "shapedy": dict(laws=BINGHAM, shaping=True, hand=HAND, **PUSHED),
    "shapedyb": dict(laws=BINGHAM, shaping=True, hand=HAND, **BACK),
    "handy": dict(laws=(((0.8, 0.0, 1.0, 0.0), (0.6, 0.0, 1.0, 0.0)),), hand=HAND, **MOVING),
    "pose": dict(laws=BINGHAM, p0=(0.1, -0.08), **BACK),
    "turnedy": dict(laws=BINGHAM, angle=0.5, **BACK),
    "turnedm": dict(laws=BINGHAM, angle=0.5, **MOVING),
    "bordersy": dict(laws=LAYERS, edges=(0.01, 0.02, 0.03), uh=(1.5, 0.3), t_end=1.0),
    "thinning": dict(laws=(THINNING,), **MOVING),
    "thinback": dict(laws=(THINNING,), **BACK),
    "thickening": dict(laws=(((0.3, 30.0, 1.5, 2.0), (0.2, 20.0, 2.0, 2.0)),), uh=(0.1, 0.3), v0=(0.1, -0.05),t_end=0.5),
    "a-coulomb": dict(laws=(((0.5, 0.0, 1.0, 0.0),) * 2,), **SLOW, **MOVING),
    "a-coulback": dict(laws=(((0.5, 0.0, 1.0, 0.0),) * 2,), **SLOW, **BACK),
    "a-bingham": dict(laws=ALIKE, **SLOW, **PUSHED),
    "a-bingback": dict(laws=ALIKE, **SLOW, **BACK),
    "a-hand": dict(laws=(((0.5, 3.0, 0.5, 0.0),) * 2,), hand=HAND, **SLOW, **MOVING),
    "a-borders": dict(laws=(NONE, ((0.6, 0.0, 1.0, 9.0),) * 2, ((0.0, 0.0, 1.0, 20.0),) * 2), edges=(0.01, 0.02),uh=(1.5, 0.3), **SLOW),
}
def case(c, dt, **more):
    laws, edges = c["laws"], c.get("edges", ())
    axes = [Profile(edges, tuple(x[i][3] for x in laws), "x", Fy=tuple(x[i][0] for x in laws),K=tuple(x[i][1] for x in laws), n=tuple(x[i][2] for x in laws)) for i in (0, 1)]
    clay = Clay(*axes, angle=c.get("angle", 0.0), isotropic=c.get("isotropic", False))
    hand = c.get("hand")
    st = dict(clay=clay, force=c.get("uh", (1.0, 0.0)),operator=hc.Operator(*hand) if hand else None, shaping=c.get("shaping", False),
        start=c.get("p0", (0.0, 0.0)), velocity=c.get("v0", (0.0, 0.0)), length=None,t_max=c.get("t_end", 1.0), gain=(1.0, 0.5), dt=dt, stop=False,**A)
    return dataclasses.replace(hc.free(), **(st | more))
for n,c in CASES.items(): S[n]=case(c,1e-3)
S['ylimit']=case(CASES['bingham'],1e-3,torque_limit=(.3,.2))
S['ylimshape']=case(CASES['bingham'],1e-3,torque_limit=(.3,.2),shaping=True)
S['yform']=case(CASES['bingback'],1e-3,compensator=ZEROS[0],torque_limit=(1.,.5))
S['yhold']=case(CASES['bingham'],1e-3,force=(.3,.1),uh=None) if 0 else dataclasses.replace(hc.free(), clay=Clay(*[Profile((), (5.0,), Fy=(0.5,))] * 2), force=(0.2, 0.1), dt=1e-3,t_max=.3, start=(0.05, 0.02),**A)
S['yfast']=case(CASES['bingham'],5e-3)
S['ystiff']=hc.Scenario(clay=slab(Flow(Fy=.5,b=2000.),.03,.1),force=(3.,.5),t_max=.5,shaping=True,**A)
S['yturnstiff']=hc.Scenario(clay=hc.Clay(P((.02,),(0,2000.),Fy=(0,.3)),P((.02,),(0,1000.),Fy=(0,.2)),angle=.5),force=(4.,1.),t_max=.5,dt=1e-3,**A)
names=sys.argv[1:] or list(S)
d=lambda a,b: float(np.abs(a-b).max()) if len(a) else 0
def reference(n):
    return hc.simulate(S[n],engine='python')
def main():
  for n in names:
    s=S[n]
    t0=time.perf_counter(); ref=reference(n); t1=time.perf_counter()
    try: rows,cr,stops,st,parts=scene.run(s)
    except Exception as ex:
        import traceback; traceback.print_exc(); print(n,'FAILED',ex); continue
    t2=time.perf_counter()
    m=min(len(rows),len(ref.p)); work=st.work; en=ref.energy
    rs=sorted((('x','y','xy').index(x.axis),on,t) for x in ref.stops for on,t in ((1,x.start),(0,x.end)) if t is not None)
    ns=sorted((int(a),int(b),t) for a,b,t in stops)
    ds=max([abs(a[2]-b[2]) for a,b in zip(ns,rs)],default=0)
    same=[a[:2] for a in ns]==[a[:2] for a in rs]
    thr=work.through or 1
    print(f"{n:10s} {ref.outcome.code:10s} {st.status.code} n {len(ref.p)} {len(rows)} p {d(rows[:m,2:4],ref.p[:m]):.1e} v {d(rows[:m,4:6],ref.v[:m]):.1e} fh {d(rows[:m,6:8],ref.fh[:m]):.1e} tau {d(rows[:m,8:10],ref.tau[:m]):.1e} dl {d(rows[:m,10:12],ref.delta[:m]):.1e} b {d(rows[:m,12:14],ref.b[:m]):.1e} cross {len(cr)} {len(ref.crossings)} {max([abs(a[2]-b.time) for a,b in zip(cr,ref.crossings)],default=0):.1e} stops {len(ns)} {len(rs)} {same} {ds:.1e} E {max(abs(work.clay-en['clay']),abs(work.motors-en['motors']),abs(work.muscle-en['muscle']) if 'muscle' in en else 0)/thr:.1e} steps {ref.steps} old {t1-t0:.2f}s new {t2-t1:.2f}s",flush=True)
if __name__=='__main__': main()
