"""`lightproof upgrade OLD.xml`: a scene of Mitsuba 0.4 to 0.6 becomes one of Mitsuba 3."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from renderer.errors import SceneError
from renderer.process.short_command import INTERRUPTED, WRONG_USE, run_command
from renderer.process.signals import output_is_lost
from renderer.process.whole_file import write_whole

DONE, NOT_ALL = 0, 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Upgrade a file, list the changes, and return the exit status."""
    given = _parser().parse_args(arguments)
    output = given.output or given.scene.with_name(f"{given.scene.stem}_upgraded.xml")
    return run_command(
        "lightproof upgrade: error",
        lambda: _upgrade(given.scene, output, force=given.force, quiet=given.quiet),
    )


def _upgrade(scene: Path, output: Path, *, force: bool, quiet: bool) -> int:
    from renderer.conversion.old_mitsuba import upgraded
    from renderer.conversion.upgrade_record import CHANGED, LEFT

    content, changes = upgraded(scene)
    if output.exists() and not force:
        same = output.samefile(scene)
        what = "is the scene itself" if same else "is there already"
        raise SceneError(f"{output}: {what}; --force overwrites it")
    write_whole(output, content)
    for change in changes:
        if not (quiet and change.kind == CHANGED):
            sys.stdout.write(f"{scene}:{change}\n")
    counts = Counter(change.kind for change in changes)
    summary = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    sys.stdout.write(f"{summary}; wrote {output}\n")
    refusal = _refusal(content, scene)
    if refusal:
        refusal = refusal.replace("<string>", str(output), 1)
        sys.stdout.write(f"lightproof does not read it yet: {refusal}\n")
    return NOT_ALL if refusal or counts[LEFT] or output_is_lost() else DONE


def _refusal(content: bytes, scene: Path) -> str:
    """Return why our reader refuses the result, or nothing."""
    from renderer.scene_file import read_string

    try:
        read_string(content, base_dir=scene.parent)  # type: ignore[arg-type]
    except SceneError as error:
        return str(error)
    return ""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lightproof upgrade",
        allow_abbrev=False,
        description="Write a scene of Mitsuba 0.4 to 0.6 as one of Mitsuba 3. Layout and "
        "comments stay. Every change is listed with its line, and all that is left as it "
        "is, with the reason. Files that the scene includes are upgraded one by one.",
        epilog=f"Exit status: {DONE} all is upgraded and lightproof reads the result, "
        f"{NOT_ALL} the file is written and something is left to do by hand, {WRONG_USE} "
        f"a file or the command line is wrong, {INTERRUPTED} interrupted. Example: "
        "lightproof upgrade old.xml -o new.xml",
    )
    add = parser.add_argument
    add("scene", type=Path, metavar="OLD.xml", help="a scene file of version 0.4 to 0.6")
    add(
        "-o",
        "--output",
        type=Path,
        metavar="NEW.xml",
        help="the new file (default: OLD_upgraded.xml, in the same folder)",
    )
    add("--force", action="store_true", help="overwrite a file that is there, or the scene")
    add("--quiet", action="store_true", help="do not list what has a new name alone")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
