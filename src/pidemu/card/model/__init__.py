"""The card language: what a card may say."""
