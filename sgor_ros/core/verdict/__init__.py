"""What becomes of a registration: the types (`result`), how they come about (`decision`)."""
