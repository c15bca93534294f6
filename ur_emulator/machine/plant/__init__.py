"""The arm as physics: drives, friction, gears, links, contacts and sensors."""
