"""The parameters of the recorder."""

from typing import Annotated, NamedTuple

from dcdrw_msgs_py.quantity import Quantity


class RecorderParams(NamedTuple):
    """What the recorder writes, and where to."""

    folder: Annotated[
        str,
        Quantity(
            "the recording's folder, which must not exist; empty: recordings/DATE-TIME, a new one for each", live=True
        ),
    ] = ''
    note: Annotated[str, Quantity('what the operator has to say of the recording', live=True)] = ''
    topics: Annotated[
        str,
        Quantity(
            'further topics, images for instance, separated by spaces, or each with its type as NAME:TYPE',
        ),
    ] = ''
    record: Annotated[bool, Quantity('begin at once: else when ~/record says so')] = False
