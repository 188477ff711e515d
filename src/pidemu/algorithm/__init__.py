"""One algorithm with numbers for names, and how a card with settings becomes one."""
