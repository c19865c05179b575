"""The node `tag_tracker` and its sources of pictures."""
