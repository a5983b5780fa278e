"""Files of gains for tiers that are made up."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from usm_baselines import registry

from usm_gym.task.conditions import PRESETS

TIERS = ("field", "basin", "sea")


def gains_file(path: Path, policy: str, tier: str | None, **gains: float) -> Path:
    """Write a file of gains that are tuned for a tier, or for nothing that it says."""
    data: dict[str, Any] = {"policy": policy, "gains": gains, "weight": 0.002}
    data["budget"] = {"trials": 9, "episodes": 8}
    if tier is not None:
        data["conditions"] = asdict(PRESETS[tier])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(data))
    return path


def register_with_tiers(monkeypatch: pytest.MonkeyPatch, folder: Path, id: str) -> None:
    """Register a PD law whose gain is 1 in the field, 2 in the basin, and 3 at sea."""
    monkeypatch.setattr(registry, "_entries", dict(registry._entries))
    monkeypatch.setattr(registry, "TUNED", folder)
    for k, tier in enumerate(TIERS, start=1):
        within = folder if tier == "field" else folder / tier
        gains_file(within / f"{id}.json", id, tier, k_p=float(k))
    registry.register(id, registry.entry("pd").factory, "made up")
