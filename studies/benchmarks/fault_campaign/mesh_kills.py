"""Runs of brakes from meshes that are killed, in assemblies and reductions most of the time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from fault_campaign import kills
from fault_campaign.finding import Finding

PART = "mesh kills"
SCENES = ("own_blocks", "brake_geometry")


def run(count: int, seed: int, work: Path, names: tuple[str, ...] = SCENES) -> Iterator[Finding]:
    """Kill `count` runs; a finding for each."""
    for finding in kills.run(count, seed, work / "mesh_kills", names, on_cluster=()):
        yield replace(finding, part=PART)
