"""Test vectors of a controller: records with its outputs, for those who test code of their own against it."""
