import sys, time, dataclasses, math
import numpy as np
import hapticclay as hc
from hapticclay.heart import scene
from hapticclay.model.flow import Flow
from hapticclay.model.constants import TS
P=hc.Profile
def slab(*a,**k): return hc.slab(*a,**k)
ALL = dict(
    jitter=5e-5, lost=0.05, encoder=65536, velocity="difference", window=5, velocity_filter=200.0,
    adc_bits=12, force_noise=0.05, force_filter=400.0, dac_bits=14, dac_range=(30.0, 20.0),
    delay=1.7 * TS, friction=(0.02, 0.01), passivity=True, coupling=hc.Coupling(3000.0, 300.0),
    seed=4,
)
PHYSICAL = {name: x for name, x in ALL.items() if name not in ("passivity", "coupling")}
def cut(parts=None, clay=None, **kw):
    kw = dict(t_max=0.3, clay=(0.01, 0.05), force=(2.0, 0.1), control="sampled") | kw
    own = {x: kw.pop(x) for x in ("torque_limit", "operator", "gain", "velocity", "stop", "compensator","controller","servo") if x in kw}
    if clay is not None: own["clay"]=clay
    parts = hc.Interface(**parts) if parts else None
    return dataclasses.replace(hc.constant_cut(**kw), interface=parts, stop=False, **own)
H=dict(operator=hc.Operator())
yl=lambda along,*law: dataclasses.replace(hc.slab(hc.Flow(*law),.01,.1),isotropic=along)
YA=yl(False,1.0,0.0,1.0,10.0); YI=yl(True,1.0,3.0,0.5,20.0)
SPR=hc.Clay(P((.01,),(0,20.),springs=(hc.Spring(),hc.Spring(k=300.,limit=2.,k1=50.,tau=.1))),P((),(5.,)))
SURF=hc.Clay(P((.01,),(0,20.),springs=(hc.Spring(),hc.Spring(k=3000.,surface=True))),P((),(5.,)))
TUR=hc.Clay(P((.01,),(0,60.)),P((.01,),(0,10.)),angle=.5)
TURY=hc.Clay(P((.01,),(0,60.),Fy=(0,.3)),P((.01,),(0,10.),Fy=(0,.2)),angle=.5)
GRO=hc.Clay(P((.01,.03),(0,50.,100.),growth=(0,0,30.)),P((),(0,)))
SMO=hc.Clay(hc.Smooth((0,.1),(-.1,.1),((10.,20.),(30.,80.),(5.,5.))),hc.Smooth((0,.1),(-.1,.1),((10.,20.),(30.,80.))))
GRV=hc.Clay.of_groove(hc.Groove((.02,.08),(-.02,.02),pressure=2e4,damping=1e5))
LAYERS=hc.Clay(P((.005,.012,.02,.03),(0,30.,200.,10.,90.)),P((.006,.02),(0,50.,10.)))
def to_pose(t, q, qd, fh, state, params):
    k, d, i = params
    e1, e2 = 0.5 * math.pi - q[0], -0.5 * math.pi - q[1]
    s1, s2 = state[0] + i * e1, state[1] + i * e2
    return (k * e1 - d * qd[0] + s1, k * e2 - d * qd[1] + s2), (s1, s2)
OWN=hc.Controller(to_pose, (0.0, 0.0), (20.0, 2.0, 0.01))
S={}
S['plain']=cut()
S['ratio3']=cut(dt=1.2e-4,Ts=3.6e-4)
S['hand']=cut(**H)
S['handphys']=cut(render="implicit",**H)
S['phys']=cut(render="implicit")
S['shaping']=cut(dt=1e-4,Ts=4e-4,shaping=True)
S['stiff']=cut(render="implicit", b=1e5, gain=(1.0, 0.1))
S['stiffhand']=cut(render="implicit", b=1e5, gain=(1.0, 0.1),**H)
S['stiffratio']=cut(render="implicit", b=1e5, gain=(1.0, 0.1),dt=1e-4,Ts=4e-4,**H)
S['notgrid']=cut(t_max=.1001)
S['weak']=cut(torque_limit=(.3,.2))
S['layers']=cut(None,LAYERS)
S['layersphys']=cut(None,LAYERS,render="implicit")
S['layersall']=cut(ALL,LAYERS)
S['growing']=cut(None,GRO,render="implicit")
S['growheld']=cut(None,GRO)
S['smooth']=cut(None,SMO,render="implicit")
S['smoothheld']=cut(None,SMO)
S['turned']=cut(None,TUR,render="implicit",**H)
S['turnedheld']=cut(None,TUR)
S['turnedyield']=cut(None,TURY,render="implicit",**H)
S['turnedyieldheld']=cut(None,TURY)
S['yieldaxis']=cut(None,YA,render="implicit",force=(4.,.4))
S['yieldaxishand']=cut(None,YA,render="implicit",force=(4.,.4),**H)
S['yieldalong']=cut(None,YI,render="implicit",force=(4.,.4))
S['yieldalonghand']=cut(None,YI,render="implicit",force=(4.,.4),dt=1e-4,Ts=3e-4,**H)
S['yieldstop']=cut(None,yl(True,3.0,0.,1.,10.),render="implicit",force=(2.,.4),t_max=.6,**H)
S['yieldstopaxis']=cut(None,yl(False,3.0,0.,1.,10.),render="implicit",force=(2.,.4),t_max=.6)
S['yieldstiff']=cut(None,yl(True,.5,0.,1.,9e4),render="implicit",force=(3.,.4),**H)
S['yieldheld']=cut(None,YA,force=(4.,.4))
S['yieldheldalong']=cut(None,YI,force=(4.,.4))
S['springs']=cut(None,SPR,render="implicit",force=(3.,1.),t_max=.6)
S['springshand']=cut(None,SPR,render="implicit",force=(3.,1.),t_max=.6,**H)
S['springsheld']=cut(None,SPR,force=(3.,1.),t_max=.6)
S['springsenc']=cut(dict(encoder=4096),SPR,force=(3.,1.),t_max=.6)
S['surf']=cut(None,SURF,render="implicit",force=(3.,1.),t_max=.6)
S['surfheld']=cut(None,SURF,force=(3.,1.),t_max=.6)
S['groove']=cut(None,GRV,render="implicit",force=(4.,.5),t_max=.6,**H)
S['grooveheld']=cut(None,GRV,force=(4.,.5),t_max=.6)
S['bare']=cut(dict())
S['bare']=dataclasses.replace(cut(),interface=hc.Interface())
for n in ("jitter","lost","encoder","adc_bits","force_noise","dac_bits","friction","passivity","coupling","delay"):
    S[n]=cut({n:ALL[n]})
S['difference']=cut(dict(encoder=65536,velocity="difference",window=5,velocity_filter=200.))
S['differenceraw']=cut(dict(velocity="difference"))
S['filter']=cut(dict(force_filter=400.))
S['filter1']=cut(dict(force_filter=500.,filter_order=1))
S['delaywhole']=cut(dict(delay=2*TS))
S['late']=cut(dict(delay=TS,passivity=True))
S['delaytiny']=cut(dict(delay=1e-5*TS))
S['jitdelay']=cut(dict(jitter=8e-5,delay=.4*TS,lost=.1))
S['all']=cut(ALL,**H)
S['allstiff']=cut(PHYSICAL,render="implicit",b=1e5,gain=(1.,.1))
S['allslow']=cut(ALL|dict(delay=.01),dt=1e-4,Ts=.05)
S['allyield']=cut(PHYSICAL,YA,render="implicit",force=(4.,.4),t_max=.2,**H)
S['allyieldheld']=cut(ALL,YI,force=(4.,.4))
S['allyieldheldax']=cut(ALL,YA,force=(4.,.4))
S['fricyield']=cut(dict(friction=(.05,.03)),YA,render="implicit",force=(4.,.4),t_max=.2)
S['fricyieldalong']=cut(dict(friction=(.5,.3)),YI,render="implicit",force=(4.,.4),t_max=.2)
S['fricstick']=cut(dict(friction=(.5,.5)),force=(1.,.1))
S['passive']=cut(dict(passivity=True),b=2000.)
S['passivedelay']=cut(dict(passivity=True,delay=1.7*TS),b=1000.)
S['couple']=cut(dict(coupling=hc.Coupling(3e3,300.)),b=1e4)
S['coupleyield']=cut(dict(coupling=hc.Coupling(3e3,300.)),YA,force=(4.,.4))
S['coupleyieldalong']=cut(dict(coupling=hc.Coupling(3e3,300.),passivity=True),YI,force=(4.,.4))
S['form']=cut(compensator=hc.Compensator((1.,20.),(1.,40.,0.)),gain=(.2,.1))
S['formlead']=cut(compensator=hc.Compensator((.02,1.,3.),(1.,40.,0.)),gain=(.2,.1),render="implicit",**H)
S['formlost']=cut(dict(lost=.1,encoder=65536),compensator=hc.Compensator((0.02, 1.0, 40.0, 30.0), (1.0, 14.0, 140.0, 400.0)))
S['gainc']=cut(compensator=hc.Compensator((0.002,), (1.0,)))
S['own']=cut(controller=OWN,render="implicit")
S['ownheld']=cut(controller=OWN)
S['ownyield']=cut(None,YA,controller=OWN)
S['ownall']=cut(PHYSICAL,controller=OWN)
S['ownphysyield']=cut(PHYSICAL,YA,controller=OWN,render="implicit",t_max=.15)
S['start']=cut(**H,velocity=(.1,.02),start=(.012,0.))
S['noclay']=dataclasses.replace(cut(),clay=None)
S['finish']=cut(t_max=2.,force=(6.,.5),length=.07,**H)
S['finishphys']=cut(t_max=2.,force=(6.,.5),length=.07,render="implicit",**H)
S['three']=cut(dict(encoder=65536,force_filter=400.,delay=1.7*TS))
S['threediff']=cut(dict(encoder=65536,velocity='difference',window=5,force_filter=400.,delay=1.7*TS))
names=sys.argv[1:] or list(S)
def outof(n,s=None):
    s=s or S[n]
    t0=time.perf_counter(); ref=hc.simulate(s,engine='python'); t1=time.perf_counter()
    rows,cr,stops,st,parts=scene.run(s)
    t2=time.perf_counter()
    m=min(len(rows),len(ref.p))
    d=lambda a,b: float(np.abs(a-b).max()) if len(a) else 0
    work,en=st.work,ref.energy
    th=max(en['throughput'],1e-30)
    ds=dict(p=d(rows[:m,2:4],ref.p[:m]),v=d(rows[:m,4:6],ref.v[:m]),fh=d(rows[:m,6:8],ref.fh[:m]),tau=d(rows[:m,8:10],ref.tau[:m]),delta=d(rows[:m,10:12],ref.delta[:m]),b=d(rows[:m,12:14],ref.b[:m]))
    T=scene.TOLD[0]
    ds['fe']=d(T[:m,:2],ref.fe[:m]) if len(T) else 0
    cross=max([abs(a[2]-b.time) for a,b in zip(cr,ref.crossings)],default=0); sp=max([abs(a[3]-b.speed) for a,b in zip(cr,ref.crossings)],default=0)
    now=[x.start for x in ref.stops]; mine=[x[2] for x in stops if x[1]>0]
    stp=max([abs(a-b) for a,b in zip(mine,now)],default=0)
    E=max(abs(work.clay-en['clay']),abs(work.motors-en['motors']),abs(work.muscle-en['muscle']),abs(work.through-en['throughput']))/th
    if work.hardware: E=max([E]+[abs(getattr(work.hardware,a)-en[b])/th for a,b in (('friction','friction'),('guard','passivity_controller'),('coupling','coupling')) if b in en])
    ok=len(rows)==len(ref.p) and len(cr)==len(ref.crossings) and len(mine)==len(now) and ds['p']<1e-12 and E<1e-9 and cross<1e-9 and stp<1e-9 and ds['fe']<1e-6 and ds['v']<1e-9 and ds['fh']<1e-6 and ds['tau']<1e-6
    print(f"{n:15s} {'ok ' if ok else 'BAD'} {ref.outcome.code:12s} {st.status.code} n {len(ref.p)} {len(rows)} "+' '.join(f"{k} {x:.1e}" for k,x in ds.items())+f" cross {len(cr)}/{len(ref.crossings)} {cross:.0e} {sp:.0e} stops {len(mine)}/{len(now)} {stp:.0e} E {E:.0e} old {t1-t0:.2f} new {t2-t1:.2f}",flush=True)
if __name__=='__main__':
  for n in names:
    try: outof(n)
    except Exception as ex:
        import traceback; traceback.print_exc(limit=-3); print(n,'FAILED',ex,flush=True)
