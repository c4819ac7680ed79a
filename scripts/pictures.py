# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes every picture of README and docs anew, so that they show the same numbers: make pictures.

    python scripts/pictures.py [--out out/pictures] [--docs docs]

demo.png is the demo's own. report.png needs Chromium. The others are taken from Blender's window by the command that
the variable FMQM_SCREENSHOT names: `... SCRIPT OUT_PREFIX` opens the window, runs the script with shot(name) and
done() in builtins, and saves OUT_PREFIX-name.png. What is missing is said, and skipped.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import demo  # beside this file
from PIL import Image

LEVELS = ((0.4, 1024), (0.15, 512), (0.06, 256))  # of the report: triangles that are kept, side of the texture
REPORT_SIZE = (1280, 1880)  # of the page; the picture is smaller
WIDTH = 880  # of the picture
WINDOW_PICTURES = {"look": ("look", "units", "slice"), "compare": ("loupe",)}  # by what pictures_window.py does
FLIP, FLIP_SIDE, HEADER = "flip.webp", 640, 52  # pixels; of the header above the view
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def run(*command: object, folder: Path | None = None) -> None:
    subprocess.run([str(part) for part in command], cwd=folder, check=True)


def script(name: str, *arguments: object, folder: Path | None = None) -> None:
    run(sys.executable, demo.ROOT / "scripts" / name, *arguments, folder=folder)


def build_levels(folder: Path) -> list[Path]:
    """The urn's levels of detail, each with fewer triangles and a smaller texture."""
    demo.bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    line = demo.outline()
    pixels = demo.paint_texture(line)
    urn = demo.build_object(line)
    decimate = urn.modifiers.new("LOD", "DECIMATE")
    paths = []
    for number, (ratio, side) in enumerate(LEVELS, 1):
        step = len(pixels) // side
        smaller = pixels.reshape(side, step, side, step, -1).mean(axis=(1, 3))
        decimate.ratio = ratio
        demo.set_texture(urn, demo.save_picture(smaller, folder / f"urn_lod{number}.jpg", "JPEG", 90))
        paths.append(folder / f"urn_lod{number}.glb")
        demo.export(paths[-1])
    return paths


def picture_of_report(out: Path, reference: Path) -> Path | None:
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        print(f"pictures.py: report.png is left as it is: none of {', '.join(BROWSERS)} is installed")
        return None
    levels = build_levels(out)
    names = [path.name for path in (reference, *levels)]  # relative: the page names what it is given
    script("score.py", *names, "--report", "report", "--attribution", folder=out)
    picture = out / "report.png"
    size = "{},{}".format(*REPORT_SIZE)
    # The browser's picture does not wait for images that may come later.
    still = (out / "report" / "index.html").read_text(encoding="utf-8")
    page = out / "report" / "still.html"
    page.write_text(still.replace(' loading="lazy" decoding="async"', ' decoding="sync"'), encoding="utf-8")
    run(
        *(
            browser,
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            "--blink-settings=imagesEnabled=true",
        ),
        *(f"--window-size={size}", "--virtual-time-budget=5000", f"--screenshot={picture}", page.as_uri()),
    )
    whole = Image.open(picture).convert("RGB")
    whole.resize((WIDTH, round(whole.height * WIDTH / whole.width)), Image.Resampling.LANCZOS).save(picture)
    return picture


def pictures_of_window(out: Path, *urns: Path) -> list[Path]:
    command = os.environ.get("FMQM_SCREENSHOT")
    if not command:
        names = ", ".join(f"{name}.png" for names in WINDOW_PICTURES.values() for name in names)
        print(f"pictures.py: {names} and {FLIP} are left as they are: FMQM_SCREENSHOT names no command for pictures")
        return []
    rectangle = out / "rectangle.json"
    found = []
    for part, names in WINDOW_PICTURES.items():
        rectangle.unlink(missing_ok=True)
        subprocess.run(
            [*shlex.split(command), str(Path(__file__).with_name("pictures_window.py")), str(out / "window")],
            env={**os.environ, "FMQM_ROOT": str(demo.ROOT), "FMQM_URNS": json.dumps([str(urn) for urn in urns]),
                 "FMQM_RECTANGLE": str(rectangle), "FMQM_SET": part},
            check=False,
        )  # fmt: skip
        if not rectangle.is_file():
            sys.exit("pictures.py: Blender's window could not be opened")
        area = json.loads(rectangle.read_text())
        for name in names:
            found.append(out / f"{name}.png")
            cut(out / f"window-{name}.png", area).save(found[-1])
    found.append(animate(out, area))
    return found


def cut(picture: Path, area: list[int]) -> Image.Image:
    """A part of the window, whose rows count from below."""
    whole = Image.open(picture).convert("RGB")
    x, y, width, height = area
    return whole.crop((x, whole.height - y - height, x + width, whole.height - y))


def animate(out: Path, area: list[int]) -> Path:
    """The Original and the LOD in turn, then the wipe from one side to the other."""
    x, y, width, height = area
    side = height - HEADER
    middle = [x + (width - side) // 2, y, side, side]
    wipes = sorted(out.glob("window-wipe-*.png"), key=lambda path: int(path.stem.rpartition("-")[2]))
    original, lod = out / "window-flip-original.png", out / "window-flip-lod.png"
    paths = [original, lod, original, lod, *wipes]
    frames = [cut(path, middle).resize((FLIP_SIDE, FLIP_SIDE), Image.Resampling.LANCZOS) for path in paths]
    milliseconds = [900] * 4 + [120] * len(wipes)
    target = out / FLIP
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=milliseconds, loop=0, quality=80, method=6)
    return target


def main() -> None:
    parser = argparse.ArgumentParser(description="Make every picture of README and docs anew.")
    parser.add_argument("--out", type=Path, default=Path("out/pictures"), help="folder for the files")
    parser.add_argument("--docs", type=Path, default=demo.ROOT / "docs", help="folder for the pictures")
    args = parser.parse_args()
    out = args.out.resolve()
    script("demo.py", "--out", out)
    urns = out / "urn.glb", out / "urn_lod.glb"
    shutil.copy(out / "demo.png", args.docs / "demo.png")
    report = picture_of_report(out, urns[0])
    for picture in (*([report] if report else []), *pictures_of_window(out, *urns)):
        if picture.suffix == ".png":
            Image.open(picture).convert("RGB").save(args.docs / picture.name, optimize=True)
        else:
            shutil.copy(picture, args.docs / picture.name)
    print(f"the pictures are in {args.docs}")


if __name__ == "__main__":
    main()
