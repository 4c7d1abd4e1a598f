"""Driving styles from tracks: features, TDBM, KDSC. Import from the submodules; importing this package is cheap."""
