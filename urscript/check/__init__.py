"""What `urscript check` says: errors with explanations and repairs (`checking`), and warnings.

A rule must not raise; programs without errors never reach one.
"""
