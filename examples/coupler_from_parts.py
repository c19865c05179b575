"""From ranges of springs and dashpots to a coupler, and how it does when it is a third off."""

import dcdrw

rig = dcdrw.preset('paper')
best = dcdrw.design(rig, k=(5.0, 50.0), b=(8.0, 60.0), seconds=8.0)['forgiving']  # of a trial: 13 steps
print(f'{best.k:.1f} N/m with {best.b:.1f} N·s/m: {best.worst_steps:g} steps from the worst of nine starts')
for factor in (0.7, 1.3):
    trial = dcdrw.simulate(rig._replace(k=factor * best.k, b=factor * best.b), phase=0.1, seconds=15.0)
    print(f'both at {factor:.0%}: {trial.steps} steps from 10 %')
