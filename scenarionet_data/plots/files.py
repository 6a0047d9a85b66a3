"""Writing of pictures and videos; the suffix of the file selects the format."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from io import BytesIO
from itertools import chain, islice
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.errors import BadParameter, needing
from scenarionet_data.plots.palette import MEANINGFUL
from scenarionet_data.storage.files.places import local_path

PICTURES = (".png", ".pdf", ".svg")
VIDEOS = (".gif", ".mp4")


def write_figure(path: Path | str, figure: Figure) -> None:
    """Write a figure as png, pdf or svg.

    Args:
        path: A .png, .pdf or .svg file.
        figure: The figure.

    Raises:
        BadParameter: The suffix is not supported.
    """
    path = local_path(path, "a picture")
    if path.suffix not in PICTURES:
        raise BadParameter(f"{path}: a picture's name ends with one of {', '.join(PICTURES)}")
    if not hasattr(figure, "savefig"):
        raise BadParameter(f"figure={figure!r}; expected one of matplotlib, such as scenario_figure(scenario)")
    with _whole(path) as file:
        figure.savefig(file)


def write_video(
    path: Path | str,
    frames: Iterable[UInt8],
    rate: float,
    on_frame: Callable[[int], None] | None = None,
) -> None:
    """Write frames as a video.

    Args:
        path: A .gif or .mp4 file.
        frames: (H, W, 3) uint8, all of one size with even height and width.
        rate: Frames per second.
        on_frame: Called with the number of finished frames.

    Raises:
        BadParameter: The suffix is not supported.
        MissingDependency: The file is an mp4 and PyAV is not installed.
    """
    writers = {".gif": _write_gif, ".mp4": _write_mp4}
    if Path(path).suffix not in writers:
        raise BadParameter(f"{path}: a video's name ends with one of {', '.join(VIDEOS)}")
    with _whole(local_path(path, "a video")) as file:
        writers[Path(path).suffix](file, _counted(frames, on_frame or (lambda _: None)), rate)


def as_webp(video: bytes, rate: float = 7.0, seconds: float = 12.0) -> bytes:
    """Convert the start of an mp4 to an animated WebP, about 3 kB per frame of 280 pixels.

    Args:
        video: Content of the mp4 file.
        rate: Maximum number of frames per second; other frames are dropped.
        seconds: Length of the result [s].
    """
    import av
    from PIL import Image

    with av.open(BytesIO(video), "r") as container:
        stream = container.streams.video[0]
        recorded = float(stream.average_rate or rate)
        step, last = max(1, math.ceil(recorded / rate)), round(seconds * recorded)
        arrays = [frame.to_ndarray(format="rgb24") for frame in islice(container.decode(stream), 0, last, step)]
    first, *others = map(Image.fromarray, arrays)
    done = BytesIO()
    duration = round(1000 * step / recorded)
    first.save(done, "WEBP", save_all=True, append_images=others, duration=duration, loop=0, quality=40)
    return done.getvalue()


def _counted(frames: Iterable[UInt8], on_frame: Callable[[int], None]) -> Iterator[UInt8]:
    for number, frame in enumerate(frames):
        on_frame(number)
        yield frame


def _write_gif(path: Path, frames: Iterator[UInt8], rate: float) -> None:
    """Write a gif whose frames share one palette, so that static parts do not flicker."""
    from PIL import Image

    first = Image.fromarray(next(frames))
    colors = first.quantize(128, dither=Image.Dither.NONE)
    meant = (np.array([to_rgb(color) for color in MEANINGFUL]) * 255).round().astype(int)
    colors.putpalette((colors.getpalette() or [])[: 3 * 128] + meant.ravel().tolist())
    pictures = chain([first], (Image.fromarray(frame) for frame in frames))
    done = (picture.quantize(palette=colors, dither=Image.Dither.NONE) for picture in pictures)
    begin = next(done)
    begin.save(path, save_all=True, append_images=done, duration=round(1000 / rate), loop=0, optimize=False)


def _write_mp4(path: Path, frames: Iterator[UInt8], rate: float) -> None:
    with needing("mp4 videos need PyAV", "video", "or write a .gif"):
        import av
    first = next(frames)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", Fraction(rate).limit_denominator(1000))
        stream.height, stream.width = first.shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "20", "preset": "superfast", "bf": "0"}
        for frame in chain([first], frames):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(stream.encode())


@contextmanager
def _whole(path: Path) -> Iterator[Path]:
    """Yield a temporary name that is renamed to ``path`` on success and removed on failure."""
    unfinished = path.with_name(f".unfinished.{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
