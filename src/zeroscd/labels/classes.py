"""The classes of ADE20K's scene parsing benchmark, and groups of them that move or grow."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.errors import SettingsError
from zeroscd.text import unknown

if TYPE_CHECKING:
    from collections.abc import Iterable

# In the order of the benchmark (Zhou et al., CVPR 2017); the first of several names of each.
_NAMES = """
    wall; building; sky; floor; tree; ceiling; road; bed; windowpane; grass; cabinet; sidewalk;
    person; earth; door; table; mountain; plant; curtain; chair; car; water; painting; sofa; shelf;
    house; sea; mirror; rug; field; armchair; seat; fence; desk; rock; wardrobe; lamp; bathtub;
    railing; cushion; base; box; column; signboard; chest of drawers; counter; sand; sink;
    skyscraper; fireplace; refrigerator; grandstand; path; stairs; runway; case; pool table; pillow;
    screen door; stairway; river; bridge; bookcase; blind; coffee table; toilet; flower; book; hill;
    bench; countertop; stove; palm; kitchen island; computer; swivel chair; boat; bar;
    arcade machine; hovel; bus; towel; light; truck; tower; chandelier; awning; streetlight; booth;
    television; airplane; dirt track; apparel; pole; land; bannister; escalator; ottoman; bottle;
    buffet; poster; stage; van; ship; fountain; conveyer belt; canopy; washer; plaything;
    swimming pool; stool; barrel; basket; waterfall; tent; bag; minibike; cradle; oven; ball; food;
    step; tank; trade name; microwave; pot; animal; bicycle; lake; dishwasher; screen; blanket;
    sculpture; hood; sconce; vase; traffic light; tray; ashcan; fan; pier; crt screen; plate;
    monitor; bulletin board; shower; radiator; glass; clock; flag"""
NAMES = tuple(" ".join(name.split()) for name in _NAMES.split(";"))
ID = {name: number for number, name in enumerate(NAMES)}

GROUPS = {
    "vehicle": ("car", "bus", "truck", "van", "bicycle", "minibike", "boat", "ship", "airplane"),
    "vegetation": ("tree", "palm", "plant", "flower", "grass", "field"),
    "water": ("water", "sea", "river", "lake", "waterfall", "fountain", "swimming pool"),
}


def class_ids(names: Iterable[str]) -> frozenset[int]:
    """Return the ids of classes and of groups of classes.

    Raises:
        SettingsError: A name is neither; the message has the nearest one.

    Example:
        >>> sorted(class_ids(["person", "vehicle"]))[:3]
        [12, 20, 76]
    """
    found: set[int] = set()
    for name in names:
        if name not in ID and name not in GROUPS:
            raise SettingsError(unknown("class", name, {**GROUPS, **ID}))
        found.update(ID[member] for member in GROUPS.get(name, (name,)))
    return frozenset(found)
