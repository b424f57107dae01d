"""Images into an animation file: mp4 through ffmpeg (extra `video`), gif through Pillow.

In: images (height, width, 4) uint8 RGBA, one after the other. Out: a file. Only one image is held
in memory for an mp4; a gif keeps them all, with 8 bits a pixel.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np
from PIL import Image

from pipeline.cli import InputError
from pipeline.extras import require

SUFFIXES = (".mp4", ".gif")
GIF_WIDTH = 1000  # pixels; a gif of full width would be several times the size of the mp4


def write_video(
    path: Path, images: Iterator[np.ndarray], *, frames_per_second: float, hold_s: float
) -> None:
    """Write the images to `path` as what its suffix says and show the last one for `hold_s` [s].

    Raises:
        InputError: another suffix than .mp4 or .gif, or mp4 without the extra.
    """
    check_video(path)
    if path.suffix == ".mp4":
        _write_mp4(path, images, frames_per_second, hold_s)
    elif path.suffix == ".gif":
        _write_gif(path, images, frames_per_second, hold_s)
    else:
        raise InputError(f"{path}: an animation is one of {', '.join(SUFFIXES)}")


def check_video(path: Path) -> None:
    """Raise the `InputError` for a missing extra before any work is done."""
    if path.suffix == ".mp4":
        require("video", f"{path}: an mp4 (a .gif needs nothing more)")


def _write_mp4(
    path: Path, images: Iterator[np.ndarray], frames_per_second: float, hold_s: float
) -> None:
    import imageio_ffmpeg

    first = next(images)
    height, width = (side - side % 2 for side in first.shape[:2])  # yuv420p: even sides
    writer = imageio_ffmpeg.write_frames(
        str(path),
        (width, height),
        pix_fmt_in="rgba",
        fps=frames_per_second,
        codec="libx264",
        quality=None,
        macro_block_size=1,
        ffmpeg_log_level="error",
        output_params=["-crf", "21", "-preset", "veryfast", "-movflags", "+faststart"],
    )
    writer.send(None)
    try:
        for image in chain([first], images):
            last = np.ascontiguousarray(image[:height, :width])
            writer.send(last)
        for _ in range(round(hold_s * frames_per_second)):
            writer.send(last)
    finally:
        writer.close()


def _write_gif(
    path: Path, images: Iterator[np.ndarray], frames_per_second: float, hold_s: float
) -> None:
    small = [_shrunk(Image.fromarray(image).convert("RGB")) for image in images]
    # One palette for all, made from three moments: colours must not flicker.
    moments = [np.asarray(small[at]) for at in (0, len(small) // 2, -1)]
    palette = Image.fromarray(np.concatenate(moments)).quantize(256, Image.Quantize.MEDIANCUT)
    colours = np.array(palette.getpalette(), np.uint8).reshape(-1, 3)
    colours[colours.min(axis=1) >= 249] = 255  # the mean of paper and of nearly paper is not white
    palette.putpalette(colours.tobytes())
    frames = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in small]
    shown = round(1000 / frames_per_second)
    frames[0].save(
        path,
        format="GIF",
        save_all=True,
        append_images=frames[1:],
        duration=[shown] * (len(frames) - 1) + [shown + round(1000 * hold_s)],
        loop=0,
        optimize=False,
    )


def _shrunk(image: Image.Image) -> Image.Image:
    if image.width <= GIF_WIDTH:
        return image
    size = (GIF_WIDTH, round(image.height * GIF_WIDTH / image.width))
    return image.resize(size, Image.Resampling.LANCZOS)
