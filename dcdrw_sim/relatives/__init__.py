"""The models that the pair is compared with: the single wheel and the rigid pair."""
