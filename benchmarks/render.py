"""How fast frames of the rig are drawn, 1280x720 on one core, beside copying and warping a picture of that size.

Read the table from left to right: milliseconds of the core per frame; frames per second; how many bare copies
(np.copyto) and how many bare warps (cv2.warpPerspective) of one whole picture take as long, measured in this same
process. Goal: 60 frames per second, motion blur and noise included. Times are the core's, so that a busy machine tells
little lies; `--frames` is how many are drawn of each kind.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial

import cv2
import numpy as np

from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_msgs_py.tagging import TagParams
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams

WARM_UP = 3
LENS = ViewParams(k1=-0.25, k2=0.06, field_of_view_deg=70.0)
KINDS: dict[str, tuple[ViewParams, LookParams]] = {
    'as by default: 4 ms, noise 2': (ViewParams(), LookParams()),
    'standing tripod': (ViewParams(follow=False), LookParams()),
    'oblique, distorted lens': (LENS._replace(pan_deg=35.0, height=1.6), LookParams()),
    'exposure 16 ms': (ViewParams(), LookParams(exposure=0.016)),
    'blur 2 px': (ViewParams(), LookParams(blur_px=2.0)),
    'nothing but the rig': (ViewParams(), LookParams(exposure=0.0, noise=0.0)),
}


def milliseconds(work: Callable[[], object], count: int) -> float:
    """Time of the core per call, the first ones aside."""
    for _ in range(WARM_UP):
        work()
    start = time.process_time()
    for _ in range(count):
        work()
    return 1e3 * (time.process_time() - start) / count


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).partition('\n')[0])
    parser.add_argument('--frames', type=int, default=200, help='frames of each kind (default 200)')
    count = parser.parse_args().frames
    cv2.setNumThreads(1)
    print(f'{"":40}{"ms":>8}{"fps":>8}{"× copy":>10}{"× warp":>10}')
    for encoding, shape in (('mono8', (720, 1280)), ('bgr8', (720, 1280, 3))):
        picture, other = (np.full(shape, grey, np.uint8) for grey in (10, 200))
        tilt = np.array(((1.0, 0.02, 3.0), (-0.02, 1.0, 5.0), (1e-5, 0.0, 1.0)))
        copy = milliseconds(partial(np.copyto, picture, other), count)
        warp = milliseconds(partial(cv2.warpPerspective, picture, tilt, (1280, 720)), count)
        for name, (view, look) in KINDS.items():
            renderer = Renderer(SceneParams(), view, look, TagParams(), view.make_camera(), encoding == 'bgr8')
            footing = Footing(SceneParams(), JointSample(0, Turn(0.0), Turn(0.25)))

            frames = (JointSample(0, Turn(k / 60, 1.0), Turn(k / 60 + 0.25, 1.0)) for k in range(count + WARM_UP))
            taken = milliseconds(lambda: renderer.draw(footing, next(frames)), count)  # noqa: B023 - called at once
            print(
                f'{encoding}, {name:33}{taken:8.2f}{1e3 / taken:8.0f}{taken / copy:10.1f}{taken / warp:10.1f}',
                flush=True,
            )


if __name__ == '__main__':
    main()
