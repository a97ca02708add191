"""What happens to a scan between its source and what is published; node and replay run this."""
