"""What a plugin has to be and to give: how it is found, what it is asked, and what is checked of its answers."""
