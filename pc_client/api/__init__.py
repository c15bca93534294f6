"""`Movement` and `drawing`, as programs that import `pc_client` use them."""
