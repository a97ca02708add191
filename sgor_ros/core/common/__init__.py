"""What every room uses: settings, checks at the door, transformations."""
