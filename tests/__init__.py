from pathlib import Path

from dcdrw.entry import keep_to_one_core

ROOT = Path(__file__).parent.parent

keep_to_one_core()
