"""Settings of one controller into settings of another, and the certificate that says how near they are."""
