"""AprilTags in pictures: detection, following, and the view of a wheel."""
