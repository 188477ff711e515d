"""Inputs that were faults once, by kind and name. Every run begins with them; add what the fuzzer finds."""
