"""Builds and installs the package, by pip and by colcon alike; metadata is in setup.cfg."""

from glob import glob

from setuptools import setup

# python_requires stands here because colcon cannot read it from setup.cfg.
setup(
    python_requires='>=3.10',
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/dcdrw']),
        ('share/dcdrw', ['package.xml']),
        ('share/dcdrw/config', glob('config/*')),
        ('share/dcdrw/launch', glob('launch/*.launch.py')),
        ('share/dcdrw/rviz', glob('rviz/*.rviz')),
        # pip puts console scripts elsewhere, where `ros2 run` does not look; under colcon the generated ones win.
        ('lib/dcdrw', glob('scripts/*')),
    ],
)
