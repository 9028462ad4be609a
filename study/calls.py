import sys
exec(open('/work/try/cmp2.py').read().split("names=")[0])
import cProfile,pstats
s=S[sys.argv[1]]
pr=cProfile.Profile(); pr.enable(); out=scene.run(s); pr.disable()
n=len(out[0])
st=pstats.Stats(pr); tot=0
rows=[]
for (f,l,name),(cc,nc,tt,ct,_) in st.stats.items():
    if nc>=0.5*n: rows.append((nc/n,name,tt/n*1e6)); tot+=nc/n
for r in sorted(rows,key=lambda r:-r[2]): print('%.1f %s %.2f'%r, end='; ')
print(); print('calls per step',tot, 'us total', sum(r[2] for r in rows))
