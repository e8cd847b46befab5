"""Every number that a decision depends on, with its reason. Lengths in metres, shares 0 ... 1."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Thresholds:
    """Parameters of the decision per element."""

    explain_within: float = 0.02
    """A planned surface explains returns this close to it, plus two sensor sigmas: usual building tolerance on site."""
    window_floor: float = 0.02
    """An element counts as standing at its place within the level's bound, but no less than this: below it, noise and
    unevenness of real surfaces would push returns out of the window."""
    least_seen_share: float = 0.02
    """With less of the exposed surface in view nothing is said."""
    least_sightings: int = 6
    """Fewer query positions in view than this are stray returns, not evidence."""
    least_rays_share: float = 1.0
    """Rays on an element times the share of it in view must reach this, unless ``partial_coverage`` is reached: a handful of
    rays on a small part of it, mixed pixels along one edge or a neighbour a little off, is no evidence on the whole."""
    absent_seen_share: float = 0.05
    """With less of the exposed surface in view an element is not called absent, whatever rays passed through."""
    present_share: float = 0.5
    """An element stands where at least this share of what was seen of it is at its place: more for than against."""
    absent_share: float = 0.25
    """It is absent when no more than this share of what was seen of it is at its place; between the two it is partial."""
    partial_coverage: float = 0.2
    """Less of the exposed surface in view supports no verdict on the whole element: partial."""
    uniform_share: float = 0.7
    """Share of the observed positions within a level for the element to reach it; the rest may fail at edges, recesses,
    fittings and where a neighbour begins (on slender members most positions are near an edge)."""
    glazed_share: float = 0.08
    """A window or door whose panes are not marked as glass stands when this share of what was seen of it is at its place:
    a slender frame around a pane that rays pass."""
    moved_gain: float = 1.5
    """A shifted place must explain this many times more than the planned one."""
    moved_seen_share: float = 0.03
    """A shifted place needs this part of the exposed surface in view at it: less is a chance alignment."""
    outline_share: float = 0.4
    """A surface found elsewhere is not the element when more than this share of its surroundings lies on it too."""
    conflict_cap: float = 0.99
    """Highest belief that a single station can give: one in a hundred returns is not what it seems (mixed pixel,
    reflection, wrong element)."""
