"""`Movement`, as programs that import `pc_client` use them."""
