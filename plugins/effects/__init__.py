"""The catalogue of effects that a battery model may lack, one group a file."""
