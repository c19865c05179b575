"""The paper's trial, and the same with a longer spring: why the paper says 7 steps."""

import dcdrw

paper = dcdrw.preset('paper')
trial = dcdrw.simulate(paper, phase=0.216)
print('as the model has it:', trial.summary.sentence)

rig = paper.resolved()
preloaded = paper._replace(D0=rig.D0 + rig.front.step_length)
for seconds in (5.0, 30.0):
    shown = dcdrw.simulate(preloaded, phase=0.216, seconds=seconds)
    print(f'with a spring one step longer, looked at for {seconds:g} s:', shown.summary.sentence)
