"""A card in words, as its data sheet."""
