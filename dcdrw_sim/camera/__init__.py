"""The virtual camera: scene, rendering, shutter and node."""
