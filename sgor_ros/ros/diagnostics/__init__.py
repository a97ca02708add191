"""What the node says about itself: /diagnostics and the log."""
