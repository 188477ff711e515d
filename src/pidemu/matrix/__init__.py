"""Every card to every card."""
