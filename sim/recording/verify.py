# SPDX-License-Identifier: Apache-2.0
"""Is an episode what it was? By its hashes, and by making it again."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from sim.recording.bag import MessageHash
from sim.recording.episode import record
from sim.recording.recipe import RECIPE, Made, read_recipe
from sim.recording.sums import SUMS, damage, read_sums
from sim.versions import not_this_world
from slam.errors import LogFormatError, OutputError
from slam.logs.bag_topics import Bag

Verdict = Literal["whole", "damaged", "same bytes", "same messages", "differs", "other world"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """``verdict`` on an episode, and why; ``ok`` when there is nothing to worry about."""

    episode: str
    verdict: Verdict
    why: str = ""

    @property
    def ok(self) -> bool:
        """Neither damaged nor different without a reason."""
        return self.verdict not in ("damaged", "differs") or "CPU or version" in self.why


def check_hashes(folder: Path) -> Finding:
    """Every file against SHA256SUMS, and the recipe against itself.

    A bag of other bytes but the very messages of the recipe was packed anew, not damaged.
    """
    try:
        made, wrong, listed = read_recipe(folder / RECIPE), damage(folder), read_sums(folder)
        for name in (RECIPE, "metadata.yaml"):
            if name not in listed:
                wrong[name] = f"{folder / SUMS} does not list {name}"
        repacked = bool(wrong) and all(name.endswith((".mcap", "metadata.yaml")) for name in wrong)
        if repacked and _has_its_messages(folder, made):
            return Finding(episode=folder.name, verdict="same messages", why="packed otherwise")
    except LogFormatError as error:
        wrong = {RECIPE: str(error)}
    verdict: Verdict = "damaged" if wrong else "whole"
    return Finding(episode=folder.name, verdict=verdict, why="; ".join(wrong.values()))


def _has_its_messages(folder: Path, made: Made) -> bool:
    try:
        return messages_sha256(folder) == made.result.get("messages_sha256")
    except LogFormatError:
        return False


def messages_sha256(folder: Path) -> str:
    """The hash of the uncompressed messages of a bag, as its writer makes it."""
    digest = MessageHash()
    with Bag(folder) as bag:
        for topic, _, stamp_ns, data in bag.raw():
            digest.take(topic, stamp_ns, data)
    return digest.hexdigest()


def regenerate(folder: Path, *, trust: bool = False) -> Finding:
    """Simulate the episode anew and compare.

    A difference on another CPU or with other versions is no damage: NumPy, MuJoCo and zstd promise
    the same bits on one machine and one version only. Then the verdict says what is different. An
    episode of another version of the world is not made: the verdict is "other world".

    trust  whether a scene that is code, by the name in the recipe, is run; else that raises
           ``UntrustedNameError``
    """
    made = read_recipe(folder / RECIPE)
    why = not_this_world(made.world)
    if why:
        return Finding(episode=folder.name, verdict="other world", why=f"not made again: {why}")
    recipe = made.recipe
    if trust:
        recipe = replace(recipe, scene=str(recipe.scene))  # as if it had been typed
    with _scratch() as scratch:
        record(recipe, Path(scratch))
        again = Path(scratch) / made.recipe.name
        same = read_sums(again) == read_sums(folder)
        result = read_recipe(again / RECIPE).result
    if same:
        return Finding(episode=folder.name, verdict="same bytes")
    return _difference(folder.name, made, str(result.get("messages_sha256")))


def _difference(episode: str, made: Made, messages: str) -> Finding:
    elsewhere = made.elsewhere()
    if messages == made.result.get("messages_sha256"):
        why = f"packed otherwise ({elsewhere})" if elsewhere else "packed otherwise"
        return Finding(episode=episode, verdict="same messages", why=why)
    if elsewhere:
        return Finding(episode=episode, verdict="differs", why=f"other CPU or version: {elsewhere}")
    return Finding(
        episode=episode,
        verdict="differs",
        why="on the same CPU and versions: its recipe does not make it (changed code?)",
    )


def _scratch() -> tempfile.TemporaryDirectory[str]:
    try:
        return tempfile.TemporaryDirectory(prefix="mobilia-")
    except OSError as error:
        raise OutputError(f"no temporary folder: {error.strerror or error}") from error
