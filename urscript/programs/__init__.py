"""Programs for the arm that come with this package, as files; clients read them and fill in their values.

They are ordinary URScript for a CB3 3.15: nothing in them is special to this package.
"""
