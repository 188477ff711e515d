"""One closed loop of an emulated controller and a process."""
