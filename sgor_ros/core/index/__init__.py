"""What finds the points of one scan near a place, and tells how far its sensor has seen."""
