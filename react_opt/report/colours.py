"""Colours that colour-blind readers tell apart (after Okabe and Ito), without matplotlib."""

from __future__ import annotations

BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"
INK, GREY, PALE = "#1A1A1A", "#6E6E6E", "#E4E4E4"
ROBOT_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, INK)
