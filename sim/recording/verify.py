# SPDX-License-Identifier: Apache-2.0
"""Is an episode what it was? By its hashes, and by making it again."""

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, cast

from scenes.scene_file import changed, located
from sim.core.versions import not_this_world
from sim.recording import topics
from sim.recording.bag import FORMAT, FORMATS, MessageHash
from sim.recording.episode import record
from sim.recording.recipe import RECIPE, Made, Recipe, read_recipe
from sim.recording.sums import SUMS, Fault, check_vouched, faults, read_sums
from sim.recording.tables import REARRANGED
from slam.errors import LogFormatError, OutputError
from slam.logs.bag_topics import Bag
from slam.names import is_code

Verdict = Literal[
    "whole", "damaged", "incomplete", "foreign", "same bytes", "same messages", "differs",
    "other world", "cannot be checked here",
]  # fmt: skip
# Exit status of each; of several the first in this order counts.
STATUS: dict[str, int] = {
    "damaged": 1, "differs": 1, "incomplete": 3, "foreign": 4, "same messages": 5,
    "cannot be checked here": 6, "whole": 0, "same bytes": 0, "other world": 0,
}  # fmt: skip
METADATA = "metadata.yaml"
_FILES = ("map.pgm", "map.yaml", METADATA, RECIPE, "relations.txt", "trajectory.tum")


@dataclass(frozen=True, kw_only=True)
class Finding:
    """``verdict`` on an episode or a folder, and why; ``ok`` when there is nothing to worry about.

    foreign  files in it that nobody vouches for
    """

    episode: str
    verdict: Verdict
    why: str = ""
    foreign: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """All is there as it was, or made otherwise by another machine, as that may be."""
        return self.status == 0

    @property
    def status(self) -> int:
        """Exit status, as ``STATUS`` has it; 0 for a difference that another machine explains."""
        explained = self.verdict in ("differs", "same messages") and "CPU or version" in self.why
        return 0 if explained else STATUS[self.verdict]


def finding(name: str, faults: Sequence[Fault]) -> Finding:
    """The worst of these faults, and all of them in words."""
    worst = next((v for v in STATUS if any(fault.kind == v for fault in faults)), "whole")
    return Finding(
        episode=name,
        verdict=cast(Verdict, worst),
        why="; ".join(fault.why for fault in faults),
        foreign=tuple(fault.name for fault in faults if fault.kind == "foreign"),
    )


def listed_in(folder: Path) -> tuple[dict[str, str], list[Fault]]:
    """What the folder's SHA256SUMS lists; nothing, and why, when it is missing or damaged."""
    try:
        return read_sums(folder), []
    except LogFormatError as error:
        missing = not os.path.lexists(folder / SUMS)
        return {}, [Fault(kind="incomplete" if missing else "damaged", name=SUMS, why=str(error))]


def check_hashes(folder: Path, planned: Recipe | None = None) -> Finding:
    """Every file against SHA256SUMS, and the recipe against itself and the one that is ``planned``.

    A bag of other bytes but the very messages of the recipe was packed again, not damaged: then all
    else must be what it was, metadata.yaml too.
    """
    if folder.is_symlink() or not folder.is_dir():
        why = "is no folder: foreign" if os.path.lexists(folder) else "is missing"
        return finding(
            folder.name, [Fault(kind="incomplete", name=folder.name, why=f"{folder} {why}")]
        )
    listed, found = listed_in(folder)
    if not listed:
        return finding(folder.name, found)
    try:
        found = faults(folder, listed, results=False)
        made = read_recipe(folder / RECIPE)
    except LogFormatError as error:
        if not any(fault.name == RECIPE for fault in found):
            found.append(Fault(kind="damaged", name=RECIPE, why=str(error)))
        return finding(folder.name, found)
    bag = f"{made.recipe.name}.mcap"
    more = (REARRANGED,) if made.recipe.rearranges else ()
    found += [
        Fault(kind="damaged", name=name, why=f"{folder / SUMS} does not list {name}")
        for name in (*_FILES, bag, *more)
        if name not in listed
    ]
    if planned is not None and made.recipe != planned:
        why = f"{folder / RECIPE} is not the recipe that is planned for it"
        found.append(Fault(kind="damaged", name=RECIPE, why=why))
    broken = [(fault.kind, fault.name) for fault in found if fault.kind != "foreign"]
    if broken == [("damaged", bag)] and _has_its_messages(folder, made):
        why = f"{folder / bag} was packed otherwise: same messages, other bytes"
        again = Fault(kind="same messages", name=bag, why=why)
        found = [again if fault.name == bag else fault for fault in found]
    return finding(folder.name, found)


def _has_its_messages(folder: Path, made: Made) -> bool:
    try:
        return messages_sha256(folder) == made.result.get("messages_sha256")
    except LogFormatError:
        return False


def check_bag(path: Path) -> None:
    """Raise ``LogFormatError`` for a bag in an episode that is not the one that was written.

    path  of the episode's folder or of its .mcap; whatever lies in no episode passes
    """
    folder = path if path.is_dir() else path.parent
    if not (folder / SUMS).is_file() or not (folder / RECIPE).is_file():
        return
    for bag in sorted(folder.glob("*.mcap")) if path.is_dir() else [path]:
        try:
            check_vouched(bag)
        except LogFormatError:
            if not _has_its_messages(folder, read_recipe(folder / RECIPE)):
                raise


def messages_sha256(folder: Path) -> str:
    """The hash of the uncompressed messages of a bag, as its writer makes it."""
    digest = MessageHash()
    with Bag(folder) as bag:
        for topic, _, stamp_ns, data in bag.raw():
            digest.take(topic, stamp_ns, data)
    return digest.hexdigest()


def regenerate(folder: Path, *, trust: bool = False) -> Finding:
    """Simulate the episode again and compare.

    A difference on another CPU or with other versions is no damage: NumPy, MuJoCo and zstd promise
    the same bits on one machine and one version only. Then the verdict says what is different. An
    episode of another version of the world, or of another format of bags, is not made: the verdict
    is "other world".

    trust  whether a scene that is code, by the name in the recipe, is run; else that raises
           ``UntrustedNameError``
    """
    made = read_recipe(folder / RECIPE)
    if why := not_this_world(made.world) or other_format(made):
        return Finding(episode=folder.name, verdict="other world", why=f"not made again: {why}")
    wanted, here = made.result.get("topics", []), topics.names()
    if wanted != here:
        why = f"not made again: it has topics {wanted!r:.200}, not {here}: load them, --with"
        return Finding(episode=folder.name, verdict="differs", why=why)
    recipe = made.recipe
    if why := changed(located(recipe.scene), recipe.scene_sha256):
        return Finding(
            episode=folder.name, verdict="differs", why=f"not made again: {recipe.scene} {why}"
        )
    if trust and is_code(recipe.scene):
        recipe = replace(recipe, scene=str(recipe.scene))  # as if it had been typed
    with _scratch() as scratch:
        record(recipe, Path(scratch))
        again = Path(scratch) / made.recipe.name
        there = read_sums(folder)  # also of what was made of the bag, in other formats
        same = all(there.get(name) == digest for name, digest in read_sums(again).items())
        result = read_recipe(again / RECIPE).result
    if same:
        return Finding(episode=folder.name, verdict="same bytes")
    return _difference(folder.name, made, str(result.get("messages_sha256")))


def other_format(made: Made) -> str:
    """Why the same frames come out as another bag here, in words; empty where they do not."""
    there = made.result.get("bag_format", 1)
    if there == FORMAT:
        return ""
    was = FORMATS.get(there, "a newer mobilia made it") if isinstance(there, int) else "unknown"
    return f"its bag is of format {there!r:.20}, this mobilia writes format {FORMAT} (then: {was})"


def _difference(episode: str, made: Made, messages: str) -> Finding:
    elsewhere = made.elsewhere()
    why = f"other CPU or version: {elsewhere}"
    if messages == made.result.get("messages_sha256"):
        why = f"packed otherwise: {why}" if elsewhere else "packed otherwise"
        return Finding(episode=episode, verdict="same messages", why=why)
    if not elsewhere:
        why = "on the same CPU and versions: its recipe does not make it (changed code?)"
    return Finding(episode=episode, verdict="differs", why=why)


def _scratch() -> tempfile.TemporaryDirectory[str]:
    try:
        return tempfile.TemporaryDirectory(prefix="mobilia-")
    except OSError as error:
        raise OutputError(f"no temporary folder: {error.strerror or error}") from error
