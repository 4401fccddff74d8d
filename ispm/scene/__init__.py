"""What is lit: plain data, numpy only, no GPU object inside."""
