"""Files of gains for tiers that are made up."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from usm_baselines import registry
from usm_baselines.gains import FOLDERS

from usm_gym.task.conditions import IN_SPACE, PRESETS, SPATIAL_PRESETS

IN_THE_PLANE = ("field", "basin", "sea")
TIERS = (*IN_THE_PLANE, *(tier + IN_SPACE for tier in IN_THE_PLANE))


def gains_file(path: Path, policy: str, tier: str | None, **gains: float) -> Path:
    """Write a file of gains that are tuned for a tier, or for nothing that it says."""
    data: dict[str, Any] = {"policy": policy, "gains": gains, "weight": 0.002}
    data["budget"] = {"trials": 9, "episodes": 8}
    if tier is not None:
        presets = PRESETS if tier in PRESETS else SPATIAL_PRESETS
        data["conditions"] = asdict(presets[tier.removesuffix(IN_SPACE)])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(data))
    return path


def register_with_tiers(monkeypatch: pytest.MonkeyPatch, folder: Path, id: str) -> None:
    """Register a PD law whose gain is 1 in the field, 2 in the basin, 3 at sea, more in space."""
    monkeypatch.setattr(registry, "_entries", dict(registry._entries))
    monkeypatch.setattr(registry, "TUNED", folder)
    for k, (within, tier) in enumerate(zip(FOLDERS.values(), TIERS, strict=True), start=1):
        gains_file(folder / within / f"{id}.json", id, tier, k_p=float(k))
    registry.register(id, registry.entry("pd").factory, "made up")
