"""AprilTags on the wheels: which, where, and how the wheel's frame looks in the picture.

The wheel's frame has its origin at the hub. At ψ = 0 its first axis points downhill along the slope, its second
outward along the slope's normal; it turns with the wheel. The camera stands on the rig's left (x downhill, y left,
z up) and looks to −y: downhill is the picture's left, and a wheel that rolls downhill turns counter-clockwise.
"""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.values import Floats

Complexes = NDArray[np.complex128]


class Family(NamedTuple):
    """An AprilTag family."""

    cells: int
    """Cells across, without the black border of one cell and the white one around it."""
    size: int
    """How many tags it has."""


CLEAR = 0.06
"""The tags sit on the axles' ends, all in one plane so far before the nearer wheel that no spoke ever hides one [ℓ]."""
SPACING = 0.2
"""From the plane of the rear wheel to that of the front wheel, which is nearer to the camera [ℓ]."""

FAMILIES = {'36h11': Family(6, 587), '16h5': Family(4, 30), '25h9': Family(5, 35), '36h10': Family(6, 2320)}


class TagGroup(NamedTuple):
    """The tags of one wheel; each list has one entry per tag."""

    ids: Annotated[tuple[int, ...], Quantity('ids of the tags', low=0)] = (0,)
    angles_deg: Annotated[
        tuple[float, ...],
        Quantity(
            "turn of each tag's upright from the slope normal at ψ = 0, positive rolling downhill",
            'deg',
            low=-360.0,
            high=360.0,
        ),
    ] = (0.0,)
    x: Annotated[
        tuple[float, ...], Quantity("each tag's centre from the hub, downhill at ψ = 0", 'm', low=-10.0, high=10.0)
    ] = (0.0,)
    y: Annotated[
        tuple[float, ...],
        Quantity("each tag's centre from the hub, along the slope normal at ψ = 0", 'm', low=-10.0, high=10.0),
    ] = (0.0,)
    standoff: Annotated[
        float,
        Quantity(
            "how far the tags are before the plane of the wheel's feet, towards the camera: the debug picture needs it",
            'm',
            low=0.0,
            high=10.0,
            derived=f'{CLEAR:g} ℓ; on the rear wheel {CLEAR + SPACING:g} ℓ, so that all tags are in one plane',
        ),
    ] = math.nan


class TagParams(NamedTuple):
    """All tags of the rig: one on each hub by default."""

    family: Annotated[str, Quantity(f'AprilTag family: {", ".join(FAMILIES)}')] = '36h11'
    size: Annotated[float, Quantity('side of the black square', 'm', above=0.0, high=5.0)] = 0.16
    front: TagGroup = TagGroup()
    rear: TagGroup = TagGroup(ids=(1,))

    def resolved(self, length: float, spacing: float = math.nan) -> 'TagParams':
        """The same tags with the derived defaults filled in.

        Args:
            length: of the legs, ℓ [m].
            spacing: between the planes of the wheels [m]; SPACING where it is NaN.

        """
        behind = SPACING * length if math.isnan(spacing) else spacing
        front, rear = (
            group._replace(standoff=CLEAR * length + further if math.isnan(group.standoff) else group.standoff)
            for group, further in ((self.front, 0.0), (self.rear, behind))
        )
        return self._replace(front=front, rear=rear)


class Mount(NamedTuple):
    """One tag where it is mounted."""

    wheel: str
    """`front` or `rear`."""
    id: int
    angle: float
    """Turn of its upright from the second axis of the wheel's frame, in the sense of ψ [rad]."""
    x: float
    """Its centre, in the wheel's frame [m]."""
    y: float
    size: float
    """Side of the black square [m]."""
    standoff: float = math.nan
    """How far it is before the plane of the wheel's feet [m]; NaN where it is not resolved."""


def mounts(params: TagParams) -> tuple[Mount, ...]:
    """Every tag of the rig.

    Raises:
        ValueError: an unknown family, lists of unequal length, or an id that stands twice or is not in the family;
            the parameter is named.

    """
    if params.family not in FAMILIES:
        raise ValueError(f'family must be one of {", ".join(FAMILIES)}, got {params.family!r}')
    found: dict[int, Mount] = {}
    for wheel, group in ((FRONT, params.front), (REAR, params.rear)):
        *lists, standoff = group
        for name, values in zip(group._fields, lists, strict=False):
            if len(values) != len(group.ids):
                raise ValueError(
                    f'{wheel}.{name} must have one entry for each of {wheel}.ids {list(group.ids)}, got {list(values)}'
                )
        for tag, angle_deg, x, y in zip(*lists, strict=True):
            if tag in found:
                raise ValueError(
                    f'{wheel}.ids: tag {tag} is mounted twice, on the {found[tag].wheel} wheel and on the '
                    f'{wheel} wheel; every tag of the rig needs an id of its own'
                )
            if tag >= FAMILIES[params.family].size:
                raise ValueError(
                    f'{wheel}.ids: family {params.family} has no tag {tag}, only 0 to '
                    f'{FAMILIES[params.family].size - 1}'
                )
            found[tag] = Mount(wheel, tag, math.radians(angle_deg), x, y, params.size, standoff)
    return tuple(found.values())


def corners(mount: Mount) -> Floats:
    """The corners of the black square in the wheel's frame (4, 2) [m]: top left, top right, bottom right, bottom left.

    Left, right, top and bottom are those of the upright tag as one looks at it, so the order is clockwise in a picture.
    """
    upright = np.array((-1.0 + 1.0j, 1.0 + 1.0j, 1.0 - 1.0j, -1.0 - 1.0j))
    return unseen(seen((mount.x, mount.y)) + 0.5 * mount.size * upright * np.exp(1j * mount.angle))


def seen(points: ArrayLike, psi: float = 0.0, slope: float = 0.0) -> Complexes:
    """Points of the wheel's frame (..., 2) as seen face-on from the camera's side: right + 1j up, from the hub [m].

    A rotation ψ [rad] turns the picture counter-clockwise, and so does a slope γ that falls to the left [rad].
    """
    points = np.asarray(points, float)
    return np.asarray((-points[..., 0] + 1j * points[..., 1]) * np.exp(1j * (psi + slope)))


def unseen(picture: Any, psi: float = 0.0, slope: float = 0.0) -> Floats:
    """Inverse of `seen`: (..., 2) [m]."""
    turned = np.asarray(picture) * np.exp(-1j * (psi + slope))
    return np.stack((-turned.real, turned.imag), axis=-1)
