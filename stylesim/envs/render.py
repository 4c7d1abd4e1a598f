"""A light picture of the scene around the ego, drawn without a display."""

from __future__ import annotations

import os
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64, UInt8

from stylesim.envs.world import Picture, Snapshot
from stylesim.geometry import box_corners
from stylesim.road import Lane
from stylesim.signals import SignalState
from stylesim.style import STYLE_CLASSES

if TYPE_CHECKING:
    from pygame import Surface

Colour = tuple[int, int, int]

SMOOTHING = 2  # drawn this much larger, then scaled down
STYLE_COLOURS: dict[str, Colour] = {  # chosen, because red to blue reads as bold to timid, also without red-green sight
    "aggressive": (178, 24, 43),
    "reckless": (239, 108, 66),
    "threatening": (246, 178, 107),
    "careful": (158, 202, 225),
    "cautious": (66, 146, 198),
    "timid": (8, 69, 148),
}
LIGHT_COLOURS: dict[int, Colour] = {
    SignalState.UNKNOWN: (150, 150, 150),
    SignalState.DARK: (60, 60, 60),
    SignalState.GREEN: (40, 190, 80),
    SignalState.YELLOW: (250, 210, 30),
    SignalState.RED: (230, 30, 30),
}
GROUND, ASPHALT, PAINT = (214, 222, 206), (112, 116, 122), (236, 236, 236)
EGO, OUTLINE, UNKNOWN_STYLE = (20, 20, 20), (255, 255, 255), (190, 190, 190)


def _pygame() -> ModuleType:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # it would write to the user's standard output
    import pygame

    return pygame


class Renderer:
    """Draws frames of one episode: road, lights on their stop lines, vehicles coloured by style, the ego in black."""

    def __init__(self, picture: Picture, *, size_px: tuple[int, int], px_per_m: float) -> None:
        self._size = (size_px[0] * SMOOTHING, size_px[1] * SMOOTHING)
        self._out = size_px
        self._scale = px_per_m * SMOOTHING
        self._stop_lines = picture.stop_lines_m
        self._asphalt = [_outline(lane) for lane in picture.road.lanes]
        self._marks = [edge for lane in picture.road.lanes if not lane.in_junction for edge in _edges(lane)]

    def frame(self, snapshot: Snapshot) -> UInt8[np.ndarray, "height width 3"]:
        """The frame centred on the ego."""
        pygame = _pygame()
        surface = pygame.Surface(self._size)
        surface.fill(GROUND)
        centre = snapshot.pose[0, :2]
        for polygon in self._asphalt:
            pygame.draw.polygon(surface, ASPHALT, self._pixels(polygon, centre))
        for edge in self._marks:
            pygame.draw.lines(surface, PAINT, False, self._pixels(edge, centre), SMOOTHING)
        for line, state in zip(self._stop_lines, snapshot.lights, strict=True):
            pygame.draw.lines(surface, LIGHT_COLOURS[int(state)], False, self._pixels(line, centre), 4 * SMOOTHING)
        self._vehicles(surface, snapshot)
        self._legend(surface, snapshot)
        small = pygame.transform.smoothscale(surface, self._out)
        return np.ascontiguousarray(pygame.surfarray.array3d(small).transpose(1, 0, 2)).astype(np.uint8)

    def _pixels(self, points_m: Float64[np.ndarray, "point 2"], centre: Float64[np.ndarray, " 2"]) -> list[list[float]]:
        shifted = (np.asarray(points_m, np.float64) - centre) * (self._scale, -self._scale)
        return list((shifted + np.array(self._size) / 2).tolist())

    def _vehicles(self, surface: Surface, snapshot: Snapshot) -> None:
        pygame = _pygame()
        corners = box_corners(snapshot.pose[:, :2], snapshot.pose[:, 4], snapshot.pose[:, 5:7])
        for row in reversed(range(len(corners))):  # the ego last, on top
            code = int(snapshot.style[row])
            colour = EGO if row == 0 else STYLE_COLOURS[STYLE_CLASSES[code]] if code >= 0 else UNKNOWN_STYLE
            points = self._pixels(corners[row], snapshot.pose[0, :2])
            pygame.draw.polygon(surface, colour, points)
            pygame.draw.polygon(surface, OUTLINE, points, SMOOTHING)
            if snapshot.crashed[row]:
                pygame.draw.line(surface, LIGHT_COLOURS[SignalState.YELLOW], points[0], points[2], 2 * SMOOTHING)
                pygame.draw.line(surface, LIGHT_COLOURS[SignalState.YELLOW], points[1], points[3], 2 * SMOOTHING)

    def _legend(self, surface: Surface, snapshot: Snapshot) -> None:
        pygame = _pygame()
        pygame.font.init()
        font = pygame.font.Font(None, 16 * SMOOTHING)
        x, y = 8 * SMOOTHING, 8 * SMOOTHING
        for name, colour in (("ego", EGO), *STYLE_COLOURS.items()):
            pygame.draw.rect(surface, colour, (x, y, 10 * SMOOTHING, 10 * SMOOTHING))
            text = font.render(name, True, EGO)
            surface.blit(text, (x + 14 * SMOOTHING, y))
            x += text.get_width() + 24 * SMOOTHING
        ego = snapshot.ego
        words = font.render(f"{ego.time_s:.1f} s   {ego.speed_mps:.1f} m/s", True, EGO)
        surface.blit(words, (8 * SMOOTHING, self._size[1] - 18 * SMOOTHING))


def _edges(lane: Lane) -> tuple[Float64[np.ndarray, "point 2"], Float64[np.ndarray, "point 2"]]:
    """Left and right edge of a lane, by its boundaries or by half its width from the centre line."""
    line = lane.centre_line_m.astype(np.float64)
    tangent = np.gradient(line, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    half = (lane.width_m if np.isfinite(lane.width_m) else 3.5) / 2
    aside = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) * half
    left = line + aside if lane.left_boundary_m is None else lane.left_boundary_m.astype(np.float64)
    right = line - aside if lane.right_boundary_m is None else lane.right_boundary_m.astype(np.float64)
    return left, right


def _outline(lane: Lane) -> Float64[np.ndarray, "point 2"]:
    left, right = _edges(lane)
    return np.concatenate([left, right[::-1]])
