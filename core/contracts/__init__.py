"""What a plugin has to be and to give: how it is found, and what is checked of its answers."""
