"""The linear law: operators, fractions without rounding, power series."""
