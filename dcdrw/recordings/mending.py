"""Mending: what can be read of a recording, whole in a new one."""

import shutil
from pathlib import Path

from dcdrw.recordings.recorder import PARAMETERS, Recorder
from dcdrw.recordings.recording import Recording

_BETWEEN_FLUSHES = 4 * 2**20
"""Messages that are kept before they are flushed [bytes]."""


def mend(recording: Recording, folder: Path) -> int:
    """Write what can be read of a recording into a new one, and its parameters with it.

    Args:
        recording: it stays as it is; its `damage` is complete afterwards.
        folder: of the new one; must not exist.

    Returns:
        How many messages it has.

    Raises:
        ValueError: the folder exists.
        OSError: the disk is full, say.

    """
    recorder = Recorder(folder, recording.about)
    try:
        if recording.parameters:
            shutil.copyfile(recording.parameters, folder / PARAMETERS)
        for topic in recording.topics.values():
            recorder.add(topic)
        pending = 0
        for message in recording.messages(list(recording.topics)):
            recorder.write(message.topic, message.data, message.log_ns)
            pending += len(message.data)
            if pending > _BETWEEN_FLUSHES:
                recorder.flush()
                pending = 0
        recorder.close()
    except OSError:
        recorder.abort()
        raise
    return sum(recorder.counts.values())
