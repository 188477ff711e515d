"""Tools for those who change pidemu; not part of the package."""
