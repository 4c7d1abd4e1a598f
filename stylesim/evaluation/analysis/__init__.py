"""The paper's analysis of styles in data sets, for any corpora: `analyze.analyze`."""
