"""What a step leaves of a small error, over the damping of the coupler."""

import dcdrw

rig = dcdrw.preset('paper')
for b in (20.0, 50.0, 100.0, 200.0):
    cycle = dcdrw.return_map(rig._replace(b=b)).fixed_point()
    print(f'b = {b:5.0f} N·s/m: largest multiplier {abs(cycle.multipliers[0]):.3f}, a step takes {cycle.period:.3f} s')
