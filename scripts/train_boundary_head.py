"""Train the boundary head of the lite segmenter on BSDS500 (train + val; scored on test).

    python scripts/train_boundary_head.py BSDS500 src/zeroscd/segmenters/boundary.safetensors

Data: BSDS500 (Arbelaez et al., PAMI 2011; non-commercial research), laid out as
{train,val,test}/{images,boundaries}; boundaries/*.png = share of people who drew a border there.
Only natural photos and human outlines are used: no photo pairs, no change labels.
"""

import argparse
import time
from pathlib import Path

import cv2
import numpy as np
import torch
from safetensors.torch import save_file
from sklearn.metrics import average_precision_score
from torch.nn import functional

from zeroscd.encoders import lite
from zeroscd.images.resizing import resize, working_size
from zeroscd.segmenters.boundary import BoundaryHead, levels_of, normalise
from zeroscd.settings import Settings

SEED = 0
SIDES_PX = (416, 512, 640)  # working sizes seen in training, one a photo and pass
AGREED, NOBODY = 0.3, 0.05  # share of people: a border, no border; in between is not asked
NEGATIVE_WEIGHT = 0.5
LEARNING_RATE = 3e-3

Drawn = tuple[np.ndarray, np.ndarray]  # a photo, and where people drew borders in it
Example = tuple[torch.Tensor, list[torch.Tensor], torch.Tensor]  # photo, descriptors, share


def photos(root: Path, splits: tuple[str, ...]) -> list[Drawn]:
    found = []
    for split in splits:
        for file in sorted((root / split / "images").iterdir()):
            drawn = cv2.imread(str(root / split / "boundaries" / f"{file.stem}.png"), 0)
            found.append((cv2.imread(str(file))[..., ::-1].copy(), drawn))
    return found


def example(encoder: lite.LiteEncoder, pair: Drawn, side_px: int) -> Example:
    """Photo and descriptors as the head sees them, and the share of people at stride 2."""
    photo, drawn = pair
    encoder.side_px = side_px
    size_hw = working_size(photo.shape[:2], side_px=side_px, multiple=lite.COARSEST_STRIDE_PX)
    working = resize(photo, size_hw)
    share = cv2.resize(drawn.astype(np.float32) / 255, size_hw[::-1])
    share = cv2.dilate(share, np.ones((3, 3)))[::2, ::2]
    levels = levels_of(encoder.encode([photo])[0])
    return normalise(working).half(), [v.half() for v in levels], torch.from_numpy(share.copy())


def predict(head: BoundaryHead, item: Example) -> torch.Tensor:
    pixels, levels, _ = item
    return head(pixels.float(), [v.float() for v in levels])[0, 0]


def loss(logits: torch.Tensor, share: torch.Tensor) -> torch.Tensor:
    border, none = share > AGREED, share <= NOBODY
    weight = none.sum() / (border.sum() + none.sum())
    total = weight * border.sum() + NEGATIVE_WEIGHT * none.sum()
    missed = functional.softplus(-logits[border]).sum() * weight
    false = functional.softplus(logits[none]).sum() * NEGATIVE_WEIGHT
    return (missed + false) / total


def average_precision(head: BoundaryHead, items: list[Example]) -> float:
    with torch.no_grad():
        return float(
            np.mean(
                [
                    average_precision_score(
                        (i[2] > AGREED).numpy().ravel(), predict(head, i).numpy().ravel()
                    )
                    for i in items
                ]
            )
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--epochs", type=int, default=5)
    arguments = parser.parse_args()
    torch.manual_seed(SEED)
    rng = np.random.default_rng(SEED)
    encoder = lite.load(Settings(), "cpu")
    start = time.perf_counter()
    train = [
        example(encoder, flip(pair) if flipped else pair, SIDES_PX[(n + flipped) % 3])
        for n, pair in enumerate(photos(arguments.root, ("train", "val")))
        for flipped in (n % 2,)
    ]
    test = [example(encoder, p, SIDES_PX[1]) for p in photos(arguments.root, ("test",))[::4]]
    print(f"{len(train)} examples in {time.perf_counter() - start:.0f} s", flush=True)
    head = BoundaryHead()
    optimiser = torch.optim.AdamW(head.parameters(), lr=LEARNING_RATE)
    steps = arguments.epochs * len(train)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, LEARNING_RATE, total_steps=steps)
    for epoch in range(arguments.epochs):
        losses = []
        for n in rng.permutation(len(train)):
            value = loss(predict(head, train[n]), train[n][2])
            optimiser.zero_grad()
            value.backward()
            optimiser.step()
            schedule.step()
            losses.append(value.item())
        precision = average_precision(head, test)
        seconds = time.perf_counter() - start
        print(
            f"epoch {epoch}: loss {np.mean(losses):.4f}, test AP {precision:.4f}, {seconds:.0f} s",
            flush=True,
        )
        save_file(head.state_dict(), arguments.out)


def flip(pair: Drawn) -> Drawn:
    photo, drawn = pair
    return photo[:, ::-1].copy(), drawn[:, ::-1].copy()


if __name__ == "__main__":
    main()
