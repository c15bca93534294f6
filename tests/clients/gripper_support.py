"""A block that grippers of other people's clients hold."""

from contextlib import contextmanager

BLOCK = 0.04  # m
PLACE = (0.5, 0.2, 0.0)  # m; a block that stands on the table is there


def move_to_place(box, tool):
    """Move the pads to where the block is."""
    pose = f"p[{PLACE[0]}, {PLACE[1]}, {PLACE[2] + tool.length}, 3.14159, 0, 0]"
    box.run_program(f"movej(get_inverse_kin({pose}), a=8, v=2)\n", wait=True)


@contextmanager
def block_between_pads(box):
    """Put a block on the table where the pads are; they must be open."""
    box.add_thing("block", "box", (BLOCK, BLOCK, BLOCK), 0.1, (*PLACE, 0, 0, 0))
    yield
    box.remove_thing("block")
