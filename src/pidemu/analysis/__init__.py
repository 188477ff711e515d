"""The loop in frequency and in stability: margins, sensitivity, the exact response to a load."""
