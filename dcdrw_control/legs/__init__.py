"""People's legs in the wheels' place: heel strikes from wearable sensors, and the phase of each leg."""
