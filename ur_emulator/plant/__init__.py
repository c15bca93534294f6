"""The arm as physics: drives, friction, gears, links, contacts and what the sensors make of them."""
