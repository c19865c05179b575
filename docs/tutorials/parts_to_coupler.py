# %% [markdown]
# # From a parts list to a coupler
#
# For a mechanical engineer: which spring and which dashpot to buy for a rig, and how sure one can be. Each step is a
# command that you can type in a terminal as well; none needs ROS. Run this script in an empty folder.

# %%
from pathlib import Path

from dcdrw.cli import main as dcdrw

PARTS = Path(__file__).parents[2] / 'config' / 'parts.csv'

# %% [markdown]
# ## The parts on sale
#
# A table with a row for each part: spring or damper, its value in whatever unit stands beside it, and what it bears.
# A catalogue copied into a spreadsheet and saved as CSV does, with a comma as decimal sign, too.

# %%
print(PARTS.read_text())

# %% [markdown]
# ## The best pair of them
#
# For wheels of 10 kg, 0.9652 m and 12 spokes on 2°, and a ramp on which a trial lasts 15 s. Every pair is judged from
# nine starts; one that asks for more force, stroke or speed than its parts bear is left out. The fastest coupler comes
# into step in the fewest steps; the most forgiving one still does where both parts are a third off and the slope is
# gentler. Before one is recommended, the monitor that judges trials has seen it come into step. The folder gets
# `pairs.csv`, all pairs that work, and `card.pdf`, a card to print.
#
#     dcdrw design --available config/parts.csv --mass 10 --slope-deg 2 --seconds 15 --out design

# %%
RIG = ['--mass', '10', '--length', '0.9652', '--spokes', '12', '--slope-deg', '2']
assert dcdrw(['design', '--available', str(PARTS), *RIG, '--seconds', '15', '--out', 'design']) == 0

# %% [markdown]
# ## The one that you hold in your hands
#
# Measured, the spring has 46 N/m and the dashpot 92 N·s/m. Its limit cycle, how far the phase swings within a step,
# and what a step leaves of an error:
#
#     dcdrw map --k 46 --b 92 --slope-deg 2

# %%
assert dcdrw(['map', '--k', '46', '--b', '92', *RIG]) == 0

# %% [markdown]
# ## How far it is from stalling
#
# Every damper takes energy; on too gentle a slope the pair stands. `gentlest` is the slope on which this coupler's
# limit cycle ends.
#
#     dcdrw regimes --k 46 --b 92 --slope-deg 2

# %%
assert dcdrw(['regimes', '--k', '46', '--b', '92', *RIG]) == 0

# %% [markdown]
# ## A rig file for the laboratory
#
# What was measured goes into a copy of `config/rig.yaml`, which every command and every node reads: `dcdrw trial
# --rig my_rig.yaml` runs the trial, `dcdrw report` puts a day of them on one page. [On the rig](../rig.md) goes on
# from here.
