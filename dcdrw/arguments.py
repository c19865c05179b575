"""Argument types of the command line: each refuses with the reason."""

import argparse
import math


def positive(text: str) -> float:
    """Parse a number > 0."""
    value = number(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f'must be > 0, got {text}')
    return value


def number(text: str) -> float:
    """Parse a finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'must be a number, got {text!r}') from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'must be finite, got {text}')
    return value


def count(text: str) -> int:
    """Parse a whole number ≥ 1."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'must be a whole number, got {text!r}') from None
    if value < 1:
        raise argparse.ArgumentTypeError(f'must be at least 1, got {text}')
    return value


def domain(text: str) -> int:
    """Parse a ROS domain; above 101 its ports would be those that Linux gives to anybody."""
    if not text.isdecimal() or int(text) > 101:
        raise argparse.ArgumentTypeError(f'must be a whole number from 0 to 101, got {text!r}')
    return int(text)
