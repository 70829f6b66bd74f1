"""What a laboratory's file holds: in words, as a picture, and in the Battery Data Format."""
