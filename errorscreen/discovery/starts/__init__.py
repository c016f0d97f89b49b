"""Starting points for joint fits."""
