"""The ports: bytes to commands, snapshots to bytes. They know neither physics nor motion and never block."""
