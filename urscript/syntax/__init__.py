"""Text to tree: the grammar, the parser, the nodes and walks over them."""
