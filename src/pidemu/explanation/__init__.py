"""One controller at its settings, explained: its gains in every form, its kicks, its noise gain, and what they rest on."""
