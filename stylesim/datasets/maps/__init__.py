"""Map formats into `SiteMap` (a `Road`, and which lights control which lanes). Import from the submodules."""
