"""Colours that several pictures share: of words, of what is unseen, and of parts that are told apart by them."""

from __future__ import annotations

import colorsys

__all__ = ["APART", "INK", "PALE", "UNSEEN", "distinct_color", "hex_of", "rgb_of"]

INK, PALE = "#1d2733", "#5d6b7a"  # of words
UNSEEN = (211, 32, 47)
# Of these eight, the red of what is unseen, the grey of what nothing explains, white and ink, no two are within 20 of
# each other in CIE Lab, for any kind of colour vision.
APART = ("#4c8fd0", "#e6a819", "#7f19e6", "#47eb89", "#9e2e7c", "#e0527c", "#123da1", "#a3ccf5")
_GOLDEN = 0.6180339887498949


def distinct_color(k: int) -> tuple[int, int, int]:
    """Red, green and blue of part `k`, 0 to 255; from the ninth on colours come near each other, but not near red."""
    if k < len(APART):
        return rgb_of(APART[k])
    shades = colorsys.hls_to_rgb(0.08 + 0.82 * ((k * _GOLDEN) % 1.0), (0.58, 0.45, 0.7)[k % 3], 0.62)
    red, green, blue = (round(255 * v) for v in shades)
    return red, green, blue


def hex_of(color: tuple[int, int, int]) -> str:
    """The same as #rrggbb."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def rgb_of(color: str) -> tuple[int, int, int]:
    """Red, green and blue of #rrggbb, 0 to 255."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)
