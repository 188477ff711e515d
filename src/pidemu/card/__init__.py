"""The card language: models, YAML with positions, the library of cards, and the rules over all of them."""
